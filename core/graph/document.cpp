#include "core/graph/document.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/graph/graph_text.h"

namespace voxloom {

namespace fs = std::filesystem;

std::string Problem::text(const fs::path& file) const {
    std::string place = file.empty() ? "graph" : file.string();
    if (mark.line > 0) place += fmt::format(":{}:{}", mark.line, mark.column);
    return node.empty() ? fmt::format("{}: {}", place, message)
                        : fmt::format("{}: node '{}': {}", place, node, message);
}

const GraphNode* Graph::find(std::string_view id) const {
    for (const GraphNode& node : nodes)
        if (node.id == id) return &node;
    return nullptr;
}

fs::path Graph::folder() const {
    return file.empty() ? fs::current_path() : fs::absolute(file).lexically_normal().parent_path();
}

// --- reading and writing ----------------------------------------------------------------------------

Document::Document() : Document(parse("voxloom: 1\nnodes: []\n")) {}

Document Document::parse(std::string text, fs::path file) {
    std::vector<Problem> problems;
    auto tree = std::make_shared<YamlNode>(parse_yaml(text, problems));
    Graph graph;
    if (problems.empty()) graph = read_graph(*tree, problems);
    if (!problems.empty()) {
        std::stable_sort(problems.begin(), problems.end(), [](const Problem& a, const Problem& b) {
            return std::pair(a.mark.line, a.mark.column) < std::pair(b.mark.line, b.mark.column);
        });
        std::vector<std::string> lines;
        for (const Problem& problem : problems) lines.push_back(problem.text(file));
        throw Error(join(lines, "\n"));
    }
    graph.file = std::move(file);
    Document document{Parsed()};
    document.text_ = std::move(text);
    document.graph_ = std::move(graph);
    document.tree_ = std::move(tree);
    return document;
}

Document Document::load(const fs::path& file) {
    std::error_code error;
    if (fs::is_directory(file, error)) fail("{}: is a folder, not a graph file", file.string());
    std::ifstream stream(file, std::ios::binary);
    if (!stream)
        fail("{}: the graph cannot be opened ({}); check the path", file.string(),
             std::generic_category().message(errno));
    // One byte more than is allowed shows that there is too much, whatever the file claims to be.
    std::string text(kMaximumGraphBytes + 1, '\0');
    stream.read(text.data(), std::streamsize(text.size()));
    if (stream.bad()) fail("{}: the graph cannot be read", file.string());
    text.resize(std::size_t(stream.gcount()));
    return parse(std::move(text), file);
}

void Document::save(const fs::path& file) {
    // Through a link, the file behind it is replaced, not the link.
    std::error_code error;
    fs::path target = fs::is_symlink(file, error) ? fs::canonical(file, error) : file;
    if (error) fail("{}: the link leads nowhere; remove it or save elsewhere", file.string());
    fs::path temporary = target;
    temporary += fmt::format(".{}.part", getpid());
    std::ofstream stream(temporary, std::ios::binary);
    stream.write(text_.data(), std::streamsize(text_.size()));
    stream.close();
    if (!stream) {
        fs::remove(temporary, error);
        fail("{}: the graph cannot be written here; check the folder, its rights and the free space",
             file.string());
    }
    fs::rename(temporary, target, error);
    if (error) {
        std::string reason = error.message();
        fs::remove(temporary, error);
        fail("{}: the graph cannot be written: {}", file.string(), reason);
    }
    graph_.file = file;
}

}  // namespace voxloom
