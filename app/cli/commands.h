// The commands of the command line. Each returns the exit status: 0 when everything asked for is
// there, 1 when something is wrong with the input, 130 after Ctrl-C. Errors are thrown to main().
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "core/graph/document.h"

namespace voxloom::cli {

struct RunArguments {
    std::filesystem::path graph;
    std::vector<std::string> overrides;      // NODE.PARAM=VALUE
    std::vector<std::string> outputs;        // NODE.PORT or NODE instead of the graph's
    std::filesystem::path out = "out";
    std::filesystem::path report;            // empty: none
    bool json = false;
    bool quiet = false;
    int threads = 0;
    int repeat = 1;
    std::vector<std::string> again;          // nodes that a repetition computes anew
    double cache_gib = 4;
    std::string sweep;                       // NODE.PARAM=A..B or A..B..STEP; empty: one run
    std::vector<std::string> every;          // NODE=N: of a sweep, runs in every n-th step alone
};
int run(const RunArguments& arguments, std::stop_token stop);
// The same of a graph that is no file; arguments.graph is not looked at.
int run(const Document& document, const RunArguments& arguments, std::stop_token stop);

// A run for each value of a parameter: pictures with the step's number, and sweep.csv, a row a step.
int sweep(const Document& document, const RunArguments& arguments, std::stop_token stop);

struct CheckArguments {
    std::filesystem::path graph;
    std::vector<std::string> overrides;
    bool json = false;
};
int check(const CheckArguments& arguments);

struct NodesArguments {
    std::string type;                        // empty: list all
    bool json = false;
    std::filesystem::path markdown;          // folder to write a page a node to
};
int nodes(const NodesArguments& arguments);

struct InfoArguments {
    std::filesystem::path file;
    bool values = false;                     // read the voxels: range, mean, share of zeros
    bool json = false;
};
int info(const InfoArguments& arguments, std::stop_token stop);

struct CompressArguments {
    std::filesystem::path in, out;
    std::string codec = "wavelet";
    std::string target = "lossless";
    std::string amount_key;                  // of the target's parameter; empty: it has none
    double amount = 0;
    std::string coder;                       // empty: the codec's own choice
    std::string faces;                       // empty: the codec's own choice
    int brick = 0;                           // 0: the codec's own choice
    std::uint64_t memory = 0;                // bytes; 0: the codec's own choice
    std::vector<std::string> overrides;      // PARAM=VALUE of the encoder
    bool json = false;
    bool quiet = false;
};
int compress(const CompressArguments& arguments, std::stop_token stop);

struct DecompressArguments {
    std::filesystem::path in, out;
    int level = 0;
    bool json = false;
    bool quiet = false;
};
int decompress(const DecompressArguments& arguments, std::stop_token stop);

struct EditArguments {
    std::filesystem::path graph;             // empty: the start page
    std::filesystem::path out = "out";
    std::string size;                        // of the window; empty: as it fits the screen
    double scale = 0;                        // 0: the screen's own
    std::filesystem::path screen;            // where to write what is on the screen; empty: nowhere
};
int edit(const EditArguments& arguments, std::stop_token stop);

}  // namespace voxloom::cli
