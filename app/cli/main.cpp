// voxloom: the command line.

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <thread>

#include "app/cli/commands.h"
#include "core/base/error.h"
#include "core/base/text.h"

namespace {

using namespace voxloom;

constexpr const char* kFooter = R"(
A graph is a YAML file of nodes: what reads, what compresses, what draws. Begin with
  voxloom run graphs/first-look.yaml                      run a graph, pictures go to out/
  voxloom run graphs/first-look.yaml --set ct.path=my.nrrd  ... on your own volume
  voxloom nodes                                           what there is to wire
  voxloom nodes slicer.render                             how to use one
  voxloom edit graphs/first-look.yaml                     wire, tune and look in a window
  voxloom check graphs/first-look.yaml                    every problem, with its line
  voxloom info my.nrrd                                    what is in a file
  voxloom compress my.nrrd my.vxw --psnr 50               compress a volume; decompress undoes it
Results go to standard output, progress and messages to standard error.)";

// Ctrl-C asks the run to stop; a second one ends the program at once.
std::stop_source stop_source;

void watch_interrupts() {
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &set, nullptr);  // before any other thread begins
    std::thread([set] {
        for (;;) {
            int signal = 0;
            if (sigwait(&set, &signal) != 0) return;
            if (stop_source.stop_requested()) std::_Exit(130);
            stop_source.request_stop();
        }
    }).detach();
}

// CLI11 would only say that the word was not expected.
void require_command(const CLI::App& app, const std::string& word) {
    if (word.empty() || word.starts_with("-")) return;
    std::vector<std::string> known;
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) known.push_back(command->get_name());
    if (std::ranges::find(known, word) == known.end())
        throw CLI::ExtrasError(fmt::format("there is no command '{}'{}", word, did_you_mean(word, known)),
                               CLI::ExitCodes::ExtrasError);
}

}  // namespace

int main(int argc, char** argv) {
    watch_interrupts();
    CLI::App app{"voxloom: compress, explore and render large volumes with graphs of nodes"};
    app.set_version_flag("--version", std::string("voxloom ") + VOXLOOM_VERSION);
    app.require_subcommand(1);
    app.footer(kFooter);
    int status = 0;

    cli::RunArguments run;
    CLI::App* command = app.add_subcommand("run", "Run a graph");
    command->add_option("graph", run.graph, "The graph (YAML)")->required();
    command->add_option("--set", run.overrides,
                        "NODE.PARAM=VALUE: another value for this run; paths are taken from here");
    command->add_option("--output", run.outputs,
                        "NODE.PORT or NODE: what to compute, instead of the graph's outputs");
    command->add_option("--out", run.out, "Folder for results")->capture_default_str();
    command->add_option("--report", run.report, "Write what every node did to this file (JSON)");
    command->add_option("--threads", run.threads, "Worker threads; 0: all cores")
        ->check(CLI::Range(0, 1024))->capture_default_str();
    command->add_option("--repeat", run.repeat,
                        "Run this many times, for timing: the nodes that draw (or those of --again) "
                        "are computed anew, the others kept; the report lists every time")
        ->check(CLI::Range(1, 1000000))->capture_default_str();
    command->add_option("--again", run.again, "NODE: what --repeat computes anew");
    command->add_option("--cache", run.cache_gib, "Memory for results, in GiB")
        ->check(CLI::Range(0.0, 1e6))->capture_default_str();
    CLI::Option* sweep = command->add_option("--sweep", run.sweep,
                        "NODE.PARAM=A..B or A..B..STEP: one run a value; files are numbered, and sweep.csv "
                        "has times, counters and measurements, a row a run");
    command->add_option("--every", run.every,
                        "NODE=N: of a sweep, this node and what depends on it run every n-th time alone")
        ->needs(sweep);
    command->add_flag("--json", run.json, "The report on standard output")->excludes(sweep);
    command->add_flag("--quiet", run.quiet, "No progress");
    command->footer("Images, tables and volumes are written to the --out folder as NODE.PORT.ext.\n"
                    "Example: voxloom run graphs/first-look.yaml --set view.size=[1024,1024] --out pictures");
    command->callback([&] { status = cli::run(run, stop_source.get_token()); });

    cli::CheckArguments check;
    command = app.add_subcommand("check", "Find every problem of a graph without running it");
    command->add_option("graph", check.graph, "The graph (YAML)")->required();
    command->add_option("--set", check.overrides, "NODE.PARAM=VALUE, as for run");
    command->add_flag("--json", check.json, "Problems and descriptions as JSON");
    command->callback([&] { status = cli::check(check); });

    cli::NodesArguments nodes;
    command = app.add_subcommand("nodes", "List the nodes there are, or tell how to use one");
    command->add_option("type", nodes.type, "A node type, such as slicer.render");
    command->add_flag("--json", nodes.json, "Whole descriptions as JSON");
    command->add_option("--markdown", nodes.markdown, "Write a page a node to this folder");
    command->callback([&] { status = cli::nodes(nodes); });

    cli::InfoArguments info;
    command = app.add_subcommand("info", "Tell what is in a volume or a compressed file");
    command->add_option("file", info.file, "A file, or a folder of DICOM or TIFF slices")->required();
    command->add_flag("--values", info.values, "Read the voxels too: range, mean, share of zeros");
    command->add_flag("--json", info.json, "As JSON");
    command->callback([&] { status = cli::info(info, stop_source.get_token()); });

    cli::CompressArguments compress;
    command = app.add_subcommand("compress", "Compress a volume to a file");
    command->add_option("in", compress.in, "A volume: a file, or a folder of slices")->required();
    command->add_option("out", compress.out, "The file to write, such as volume.vxw, or .vxb of codecs other than wavelet")
        ->required();
    command->add_option("--codec", compress.codec, "The codec: a NAME of which there are nodes NAME.encode and NAME.write")
        ->capture_default_str();
    command->add_option("--coder", compress.coder, "The codec's entropy coder, such as dense or fast");
    command->add_option("--brick", compress.brick, "Voxels of a brick along each axis");
    command->add_option("--faces", compress.faces, "How neighbouring bricks meet, such as block or shared");
    command->add_option("--memory", compress.memory, "Memory that encoding may take, such as 500M or 2G")
        ->transform(CLI::AsSizeValue(false));
    command->add_option("--set", compress.overrides, "PARAM=VALUE of the encoder, whatever it has");
    CLI::Option_group* target = command->add_option_group("target", "What to reach; without, nothing is lost");
    target->require_option(0, 1);
    target->add_flag_callback("--lossless", [&] { compress.target = "lossless"; }, "Every bit comes back");
    const auto aim = [&](const char* option, const char* choice, const char* key, const char* doc) {
        target->add_option_function<double>(option, [&compress, choice, key](double amount) {
            compress.target = choice;
            compress.amount_key = key;
            compress.amount = amount;
        }, doc);
    };
    aim("--psnr", "psnr", "psnr", "Peak signal-to-noise ratio over the value range, in dB");
    aim("--max-error", "max-error", "max_error", "No voxel is further off than this");
    aim("--bpv", "bpv", "bpv", "Bits a voxel, everything included");
    aim("--ratio", "ratio", "ratio", "Bytes of the original over bytes of the file");
    aim("--precision", "precision", "precision", "Bit planes that are kept, of codecs that count them");
    aim("--distance", "distance", "distance", "Visual distance, of codecs that know one; 1 is just not seen");
    aim("--threshold", "threshold", "threshold", "Wavelet coefficients below this are dropped");
    command->add_flag("--json", compress.json, "The report on standard output");
    command->add_flag("--quiet", compress.quiet, "No progress");
    command->footer("Examples: voxloom compress head.nrrd head.vxw --psnr 50\n"
                    "          voxloom compress head.nrrd head.vxb --codec blosc --coder lz4 --set level=9");
    command->callback([&] { status = cli::compress(compress, stop_source.get_token()); });

    cli::DecompressArguments decompress;
    command = app.add_subcommand("decompress", "Decode a compressed file to a volume");
    command->add_option("in", decompress.in, "The compressed file")->required();
    command->add_option("out", decompress.out, "The volume to write, such as volume.nrrd")->required();
    command->add_option("--level", decompress.level, "0 is the finest; each further one has half the samples")
        ->check(CLI::Range(0, 64))->capture_default_str();
    command->add_flag("--json", decompress.json, "The report on standard output");
    command->add_flag("--quiet", decompress.quiet, "No progress");
    command->footer("Example: voxloom decompress head.vxw head.nrrd --level 1");
    command->callback([&] { status = cli::decompress(decompress, stop_source.get_token()); });

    cli::EditArguments edit;
    command = app.add_subcommand("edit", "Wire, tune and look at a graph in a window");
    command->add_option("graph", edit.graph, "The graph (YAML); without, a page to start from");
    command->add_option("--out", edit.out, "Folder for written files and screenshots")->capture_default_str();
    command->add_option("--size", edit.size, "WIDTHxHEIGHT of the window; 1600x960 without it, or as much of it as the screen has");
    command->add_option("--scale", edit.scale, "Pixels a unit of the interface; 0: the screen's own")
        ->check(CLI::Range(0.0, 8.0))->capture_default_str();
    command->add_option("--screen", edit.screen,
                        "Write what is on the screen to this file (JSON) whenever it is drawn");
    command->callback([&] { status = cli::edit(edit, stop_source.get_token()); });

    try {
        require_command(app, argc > 1 ? argv[1] : "");
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        return app.exit(e) == 0 ? 0 : 2;
    } catch (const Cancelled&) {
        fmt::print(stderr, "voxloom: cancelled\n");
        status = 130;
    } catch (const std::exception& e) {
        fmt::print(stderr, "{}\n", e.what());
        status = 1;
    }
    std::fflush(stdout);
    return status;
}
