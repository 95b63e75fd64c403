// Any bytes as a graph document: it is refused with an Error, or it can be checked, edited and the
// edits undone to the very same text.
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "core/base/error.h"
#include "core/graph/check.h"

namespace {

using namespace voxloom;

void require(bool holds, const char* what, const std::string& text) {
    if (holds) return;
    std::fprintf(stderr, "%s:\n%s\n", what, text.c_str());
    std::abort();
}

const Registry& registry() {
    static const Registry built = [] {
        Registry r;
        NodeType type;
        type.id = "fake.add";
        type.title = "Add";
        type.doc = "Adds.";
        type.inputs = {{"volume", PortType::volume, "In.", true},
                       {"more", PortType::volume, "In.", true, true}};
        type.outputs = {{"volume", PortType::volume, "Out."}};
        type.params = {param::real("amount", 1, "."),   param::list("numbers", {}, "."),
                       param::rows("rows", 2, {}, "."), param::texts("texts", {}, "."),
                       param::path_in("path", "."),     param::boolean("flag", false, ".")};
        type.evaluate = [](Evaluation&) {};
        r.add(type);
        return r;
    }();
    return built;
}

// The edit is refused with a sentence, or undone and done again bit for bit.
template <class F>
void try_edit(Document& document, F&& edit) {
    std::string before = document.text();
    bool could_undo = document.can_undo();
    try {
        edit();
    } catch (const Error& e) {
        require(std::string(e.what()).find("cannot be written into this text") == std::string::npos,
                "an edit that no layout should refuse", before);
        require(document.text() == before, "a refused edit changed the text", before);
        return;
    }
    if (!document.can_undo() || (could_undo && document.text() == before)) return;
    std::string after = document.text();
    document.undo();
    require(document.text() == before, "undo does not give the text back", before);
    document.redo();
    require(document.text() == after, "redo does not give the text back", after);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string text(reinterpret_cast<const char*>(data), size);
    Document document;
    try {
        document = Document::parse(text, "g.yaml");
    } catch (const Error&) {
        return 0;
    }
    Plan plan = check(document.graph(), registry());
    for (const Problem& problem : plan.problems)
        require(!problem.text("g.yaml").empty(), "no sentence", text);

    try_edit(document, [&] { document.add_node("fuzzed", "fake.add", glm::dvec2(1, 2)); });
    std::vector<std::string> ids;
    for (const GraphNode& node : document.graph().nodes)
        if (ids.size() < 4) ids.push_back(node.id);
    for (const std::string& id : ids) {
        const GraphNode node = *document.graph().find(id);
        if (!node.params.empty()) {
            try_edit(document,
                     [&] { document.set_param(id, node.params[0].key, std::string("a: #b")); });
            try_edit(document, [&] { document.reset_param(id, node.params.back().key); });
        }
        if (!node.inputs.empty())
            try_edit(document, [&] { document.disconnect(id, node.inputs[0].port); });
        try_edit(document, [&] { document.set_param(id, "rows", Rows{{0, 1}, {2.5, 3}}); });
        try_edit(document, [&] { document.connect(ids[0], "volume", id, "volume", true); });
        try_edit(document, [&] { document.move_node(id, {3, 4}); });
        try_edit(document,
                 [&] { document.rename_node(id, "renamed-" + std::to_string(size % 10)); });
    }
    try_edit(document, [&] { document.set_outputs({{document.graph().nodes[0].id, "volume"}}); });
    try_edit(document, [&] { document.remove_node(document.graph().nodes[0].id); });
    while (document.can_undo()) document.undo();
    require(document.text() == text, "undoing everything does not give the text back", text);
    return 0;
}
