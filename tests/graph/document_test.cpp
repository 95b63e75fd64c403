#include "core/graph/document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <clocale>
#include <cmath>
#include <functional>
#include <locale>
#include <map>
#include <sstream>

#include "core/base/error.h"
#include "core/base/text.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

std::string refusal_of(const std::string& text) {
    try {
        Document::parse(text, "g.yaml");
    } catch (const Error& e) {
        return e.what();
    }
    return "";
}

TEST(Document, aTabInTheIndentationIsNamed) {
    EXPECT_THAT(refusal_of("voxloom: 1\nnodes:\n  - id: a\n\ttype: b\n"), StartsWith("g.yaml:4:1: "));
    EXPECT_THAT(refusal_of("voxloom: 1\nnodes:\n  - id: a\n\ttype: b\n"), HasSubstr("here is a tab"));
}

template <class F>
std::string error_of(F&& f) {
    try {
        f();
    } catch (const Error& e) {
        return e.what();
    }
    return "";
}

// The text after one edit; undoing it must give the text before, redoing it the text after.
template <class F>
std::string after(const std::string& text, F&& edit) {
    Document document = Document::parse(text);
    edit(document);
    std::string edited = document.text();
    EXPECT_TRUE(same_content(Document::parse(edited).graph(), document.graph()));
    if (edited != text) {
        document.undo();
        EXPECT_EQ(document.text(), text);
        document.redo();
        EXPECT_EQ(document.text(), edited);
    }
    EXPECT_FALSE(document.can_redo());
    return edited;
}

constexpr const char* kGraph = R"(# A picture of the head.
voxloom: 1
outputs: [view.image]   # what is shown
nodes:
  - id: ct
    type: readers.volume
    set: { path: "head.nrrd" }  # the data

  # how it is drawn
  - id: view
    type: slicer.render
    in:
      source: ct.volume    # the wire
      camera: orbit.camera
    set:
      size: [512, 512]
      step: 0.50           # in voxels
      background: [0, 0,   # red, green
                   0, 1]
    at: [640, 120]
  - { id: orbit, type: scene.camera, set: { azimuth: 30, note: 'it''s here' } }
)";

// --- reading
// ---------------------------------------------------------------------------------------

TEST(DocumentRead, KeepsIdsWiresParametersAndPlaces) {
    Graph graph = Document::parse(kGraph, "dir/g.yaml").graph();
    ASSERT_EQ(graph.nodes.size(), 3u);
    const GraphNode& view = graph.nodes[1];
    EXPECT_EQ(view.id, "view");
    EXPECT_EQ(view.type, "slicer.render");
    EXPECT_EQ(view.mark.line, 10);
    EXPECT_EQ(view.mark.column, 9);
    EXPECT_EQ(view.type_mark.line, 11);
    ASSERT_EQ(view.inputs.size(), 2u);
    EXPECT_EQ(view.inputs[1].port, "camera");
    EXPECT_EQ(view.inputs[1].from[0].node, "orbit");
    EXPECT_EQ(view.inputs[1].from[0].port, "camera");
    EXPECT_EQ(view.inputs[1].mark.line, 14);
    ASSERT_EQ(view.params.size(), 3u);
    EXPECT_EQ(view.params[1].yaml.text, "0.50");
    EXPECT_EQ(view.params[2].yaml.items.size(), 4u);
    EXPECT_EQ(view.params[2].yaml.items[2].mark.line, 19);
    EXPECT_EQ(*view.at, glm::dvec2(640, 120));
    EXPECT_EQ(graph.nodes[2].params[1].yaml.text, "it's here");
    EXPECT_EQ(graph.nodes[2].params[1].yaml.kind, GraphParam::Yaml::Kind::quoted);
    ASSERT_EQ(graph.outputs.size(), 1u);
    EXPECT_EQ(graph.outputs[0].node, "view");
    EXPECT_EQ(graph.folder(), std::filesystem::current_path() / "dir");
}

TEST(DocumentRead, CountsColumnsInCharactersAndSkipsAByteOrderMark) {
    Graph graph =
        Document::parse(
            "\xef\xbb\xbfvoxloom: 1\r\nnodes: [{ id: a, set: { note: \"\xc3\xa9\xe2\x82\xac\", "
            "x: 1 }, type: t }]\r\n")
            .graph();
    ASSERT_EQ(graph.nodes.size(), 1u);
    EXPECT_EQ(graph.nodes[0].params[1].mark.line, 2);
    EXPECT_EQ(graph.nodes[0].params[1].mark.column, 37);
}

TEST(DocumentRead, CollectsEveryProblemWithItsPlace) {
    std::string all = refusal_of(R"(voxloom: 1
ouputs: [a.b]
nodes:
  - id: a
    type: t
    sett: { x: 1 }
    in: { source: [b.c, d.e.f] }
    at: [1]
  - type: t
  - id: a
    type: t
    set: { x: , y: { z: 1 } }
  - id: Big
  - 7
)");
    EXPECT_EQ(
        all,
        "g.yaml:2:1: unknown key 'ouputs'; did you mean 'outputs'?; a graph has: voxloom, outputs, "
        "nodes, editor\n"
        "g.yaml:6:5: node 'a': unknown key 'sett'; did you mean 'set'?; a node has: id, type, use, "
        "in, set, at\n"
        "g.yaml:7:25: node 'a': input 'source' is 'd.e.f'; write node.port\n"
        "g.yaml:8:9: node 'a': 'at' must be two numbers, such as [640, 120]\n"
        "g.yaml:9:5: this node has no 'id'; give it a name\n"
        "g.yaml:10:9: there are two nodes 'a', here and in line 4; give each an id of its own\n"
        "g.yaml:12:14: node 'a': parameter 'x' has no value; give it one or remove the key (a text "
        "'~' "
        "or 'null' needs quotes)\n"
        "g.yaml:12:20: node 'a': parameter 'y' is a map; a parameter is a value or a list\n"
        "g.yaml:13:5: this node has no 'type'; 'voxloom nodes' lists what there is\n"
        "g.yaml:13:9: the id 'Big' is not a name of at most 100 lower-case letters, digits, '_' "
        "and '-'\n"
        "g.yaml:14:5: a node must be a map with 'id' and 'type', this is a single value");
}

TEST(DocumentRead, NamesBothLinesOfADuplicateKey) {
    EXPECT_EQ(refusal_of("voxloom: 1\nnodes:\n- id: a\n  type: t\n  set:\n    x: 1\n    x: 2\n"),
              "g.yaml:7:5: key 'x' stands twice, here and in line 6; remove one of the two");
    EXPECT_THAT(refusal_of("voxloom: 1\nvoxloom: 1\nnodes: []\nnodes: []\n"),
                HasSubstr("g.yaml:4:1: key 'nodes' stands twice, here and in line 3"));
}

TEST(DocumentRead, RefusesWhatAGraphHasNoUseFor) {
    EXPECT_THAT(refusal_of("voxloom: 1\nnodes: &x []\n"),
                StartsWith("g.yaml:2:8: anchors and aliases"));
    EXPECT_THAT(refusal_of("voxloom: 1\nnodes: *x\n"), StartsWith("g.yaml:2:8: "));
    EXPECT_THAT(refusal_of("voxloom: !!int 1\n"), StartsWith("g.yaml:1:10: tags"));
    EXPECT_THAT(refusal_of("voxloom: 1\nnodes: !x\n"), HasSubstr("tags"));
    EXPECT_THAT(refusal_of("%YAML 1.2\n---\nvoxloom: 1\n"), StartsWith("g.yaml:1:1: directives"));
    EXPECT_THAT(refusal_of("voxloom: 1\n---\nvoxloom: 1\n"),
                StartsWith("g.yaml:2:1: a second document"));
    EXPECT_THAT(refusal_of("? voxloom\n: 1\n"), StartsWith("g.yaml:1:1: keys written with '?'"));
    EXPECT_THAT(refusal_of("voxloom: 1\nnodes: [a: b]\n"), HasSubstr("must stand in braces"));
    EXPECT_EQ(refusal_of("voxloom: 1\nnodes"), "g.yaml:2:1: this key has no ':' behind it");
    EXPECT_THAT(refusal_of("voxloom: 1\n[a]: b\n"), HasSubstr("a key must be a name"));
    EXPECT_THAT(refusal_of("voxloom: 1\nx: " + std::string(40, '[') + std::string(40, ']') + "\n"),
                StartsWith("g.yaml:2:19: lists and maps are nested more than 16 deep"));
    EXPECT_THAT(refusal_of("voxloom: 1\nx: |2\n   a\n"), HasSubstr("indentation number"));
    EXPECT_THAT(refusal_of("voxloom: 1\nx: \xff\n"),
                StartsWith("g.yaml:2:4: this byte is not UTF-8"));
    EXPECT_THAT(refusal_of(std::string("voxloom: 1\nx: \0\n", 16)),
                HasSubstr("control character (0x00)"));
    EXPECT_THAT(refusal_of("voxloom: 1\nx: [1\n"), HasSubstr("g.yaml:"));
    EXPECT_THAT(refusal_of(std::string((16u << 20) + 1, ' ')), HasSubstr("at most 16.0 MiB"));
}

TEST(DocumentRead, NamesAVersionThatItDoesNotKnow) {
    EXPECT_EQ(refusal_of("voxloom: 2\nwhatever: 3\n"),
              "g.yaml:1:10: 'voxloom: 2' is a version that this program does not know, it reads 1; "
              "use a newer "
              "program, or write 'voxloom: 1'");
    EXPECT_THAT(refusal_of("nodes: []\n"), HasSubstr("there is no 'voxloom: 1'"));
    EXPECT_THAT(refusal_of(""), HasSubstr("the text is empty"));
    EXPECT_THAT(refusal_of("# only this\n"), HasSubstr("the text is empty"));
    EXPECT_THAT(refusal_of("hello"), HasSubstr("a graph is a map"));
}

TEST(DocumentRead, SaysWhyAFileCannotBeOpened) {
    testing::TempFolder folder;
    EXPECT_THAT(error_of([&] { Document::load(folder.path() / "no.yaml"); }),
                HasSubstr("no.yaml: the graph cannot be opened (No such file or directory)"));
    EXPECT_THAT(error_of([&] { Document::load(folder.path()); }), HasSubstr("is a folder"));
}

// --- parameters
// --------------------------------------------------------------------------------------

TEST(ParseParam, ConvertsByTheKindOfTheParameter) {
    auto parse = [](const ParamSpec& spec, const std::string& yaml) {
        Graph graph =
            Document::parse("voxloom: 1\nnodes: [{id: a, type: t, set: {x: " + yaml + "}}]\n")
                .graph();
        std::string reason;
        auto value = parse_param(spec, graph.nodes[0].params[0].yaml, reason);
        return value ? to_yaml(*value) : "! " + reason;
    };
    EXPECT_EQ(parse(param::boolean("x", false, "."), "true"), "true");
    EXPECT_EQ(parse(param::boolean("x", false, "."), "yes"), "! must be true or false, not 'yes'");
    EXPECT_EQ(parse(param::boolean("x", false, "."), "'true'"),
              "! must be true or false, not the text \"true\"");
    EXPECT_EQ(parse(param::integer("x", 0, "."), "12"), "12");
    EXPECT_EQ(parse(param::integer("x", 0, "."), "1e3"), "1000");
    EXPECT_EQ(parse(param::integer("x", 0, "."), "1.5"), "! must be a whole number");
    EXPECT_EQ(parse(param::integer("x", 0, "."), "\"12\""),
              "! must be a whole number, not the text \"12\"; remove the quotes");
    EXPECT_EQ(parse(param::real("x", 0, ".").range(0, 1), "2"), "! must be between 0 and 1, not 2");
    EXPECT_EQ(parse(param::real("x", 0, "."), "-.inf"), "-.inf");
    EXPECT_EQ(parse(param::real("x", 0, "."), "0x10"), "! must be a number, not '0x10'");
    EXPECT_EQ(parse(param::text("x", "", "."), "12"), "\"12\"");
    EXPECT_EQ(parse(param::text("x", "", "."), "[a]"), "! must be a text, not a list");
    EXPECT_EQ(parse(param::choice("x", {"red", "green"}, "red", "."), "gren"),
              "! 'gren' is not one of red, green; did you mean 'green'?");
    EXPECT_EQ(parse(param::vector("x", {1, 2}, "."), "[3, 4]"), "[3, 4]");
    EXPECT_EQ(parse(param::vector("x", {1, 2}, "."), "[3]"), "! must have 2 numbers, not 1");
    EXPECT_EQ(parse(param::vector("x", {1, 2}, "."), "[3, b]"),
              "! must be a list of numbers, but item 2 is 'b'");
    EXPECT_EQ(parse(param::list("x", {}, "."), "[]"), "[]");
    EXPECT_EQ(parse(param::rows("x", 2, {}, "."), "[[0, 1], [2, 3]]"), "[[0, 1], [2, 3]]");
    EXPECT_EQ(parse(param::rows("x", 2, {}, "."), "[[0, 1], 2]"),
              "! row 2 must be a list of numbers such as [1, 2], not '2'");
    EXPECT_EQ(parse(param::texts("x", {}, "."), "[a, 'b c', 3]"), "[a, \"b c\", \"3\"]");
    EXPECT_EQ(parse(param::texts("x", {}, "."), "a"),
              "! must be a list of texts such as [a, b], not 'a'");
}

// --- edits
// ---------------------------------------------------------------------------------------------

std::string replaced(std::string text, const std::string& what, const std::string& by) {
    std::size_t at = text.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    return text.replace(at, what.size(), by);
}

TEST(DocumentEdit, ReplacesAValueAndNothingElse) {
    EXPECT_EQ(after(kGraph, [](Document& d) { d.set_param("view", "step", 0.1); }),
              replaced(kGraph, "0.50", "0.1"));
    EXPECT_EQ(
        after(kGraph, [](Document& d) { d.set_param("ct", "path", std::string("a b.nrrd")); }),
        replaced(kGraph, "head.nrrd", "a b.nrrd"));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.set_param("orbit", "azimuth", std::int64_t(45)); }),
              replaced(kGraph, "30", "45"));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.set_param("orbit", "note", std::string("x")); }),
              replaced(kGraph, "'it''s here'", "x"));
    EXPECT_EQ(after(kGraph,
                    [](Document& d) {
                        d.set_param("view", "size", std::vector<double>{64, 512});
                    }),
              replaced(kGraph, "[512, ", "[64, "));
    EXPECT_EQ(after(kGraph,
                    [](Document& d) {
                        d.set_param("view", "background", std::vector<double>{0, 0, 0, 0.5});
                    }),
              replaced(kGraph, "0, 1]\n    at", "0, 0.5]\n    at"));
    EXPECT_EQ(after(kGraph,
                    [](Document& d) {
                        d.move_node("view", {1.5, -2});
                    }),
              replaced(kGraph, "[640, 120]", "[1.5, -2]"));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.connect("ct", "other", "view", "source"); }),
              replaced(kGraph, "ct.volume", "ct.other"));
}

TEST(DocumentEdit, AddsEntriesInTheStyleOfTheirSurroundings) {
    EXPECT_EQ(after(kGraph, [](Document& d) { d.set_param("view", "shading", true); }),
              replaced(kGraph, "0, 1]\n", "0, 1]\n      shading: true\n"));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.set_param("orbit", "fit", 0.9); }),
              replaced(kGraph, "here' }", "here', fit: 0.9 }"));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.connect("ct", "volume", "orbit", "source"); }),
              replaced(kGraph, "scene.camera, set",
                       "scene.camera,\n      in: { source: ct.volume }, set"));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.connect("orbit", "lights", "view", "lights"); }),
              replaced(kGraph, "orbit.camera\n", "orbit.camera\n      lights: orbit.lights\n"));
    EXPECT_EQ(after(kGraph,
                    [](Document& d) {
                        d.move_node("ct", {0, 0});
                    }),
              replaced(kGraph, "# the data\n", "# the data\n    at: [0, 0]\n"));
    EXPECT_EQ(
        after(kGraph, [](Document& d) { d.add_node("tf", "scene.transfer", glm::dvec2(1, 2)); }),
        std::string(kGraph) + "  - id: tf\n    type: scene.transfer\n    at: [1, 2]\n");
    EXPECT_EQ(after(kGraph, [](Document& d) { d.connect("ct", "volume", "view", "source", true); }),
              replaced(kGraph, "source: ct.volume ", "source: [ct.volume, ct.volume] "));
}

TEST(DocumentEdit, RemovesEntriesWithTheirLines) {
    EXPECT_EQ(after(kGraph, [](Document& d) { d.reset_param("view", "step"); }),
              replaced(kGraph, "      step: 0.50           # in voxels\n", ""));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.reset_param("ct", "path"); }),
              replaced(kGraph, "    set: { path: \"head.nrrd\" }  # the data\n", ""));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.reset_param("orbit", "azimuth"); }),
              replaced(kGraph, "azimuth: 30, ", ""));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.reset_param("orbit", "note"); }),
              replaced(kGraph, ", note: 'it''s here'", ""));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.disconnect("view", "camera"); }),
              replaced(kGraph, "      camera: orbit.camera\n", ""));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.set_outputs({}); }),
              replaced(kGraph, "outputs: [view.image]   # what is shown\n", ""));
    EXPECT_EQ(
        after(kGraph, [](Document& d) { d.remove_node("orbit"); }),
        replaced(
            replaced(kGraph, "      camera: orbit.camera\n", ""),
            "  - { id: orbit, type: scene.camera, set: { azimuth: 30, note: 'it''s here' } }\n",
            ""));
}

TEST(DocumentEdit, RenamesANodeWithItsWiresAndOutputs) {
    EXPECT_EQ(after(kGraph, [](Document& d) { d.rename_node("view", "picture"); }),
              replaced(replaced(kGraph, "view.image", "picture.image"), "id: view", "id: picture"));
    EXPECT_EQ(after(kGraph, [](Document& d) { d.rename_node("ct", "null"); }),
              replaced(replaced(kGraph, "id: ct", "id: \"null\""), "ct.volume", "null.volume"));
}

TEST(DocumentEdit, FillsAnEmptyDocument) {
    Document document;
    document.add_node("a", "t");
    document.set_param("a", "x", 0.1);
    document.add_node("b", "u", glm::dvec2(3, 4));
    document.connect("a", "out", "b", "in");
    document.set_outputs({{"b", "image"}, {"a", ""}});
    EXPECT_EQ(document.text(), R"(voxloom: 1
outputs: [b.image, a]
nodes:
  - id: a
    type: t
    set: { x: 0.1 }
  - id: b
    type: u
    in: { in: a.out }
    at: [3, 4]
)");
    document.remove_node("a");
    document.remove_node("b");
    EXPECT_EQ(document.text(), "voxloom: 1\nnodes: []\n");
    while (document.can_undo()) document.undo();
    EXPECT_EQ(document.text(), Document().text());
}

TEST(DocumentEdit, WorksOnEveryLayout) {
    // No newline at the end.
    EXPECT_EQ(after("voxloom: 1\nnodes:\n- id: a\n  type: t",
                    [](Document& d) { d.set_param("a", "x", true); }),
              "voxloom: 1\nnodes:\n- id: a\n  type: t\n  set: { x: true }");
    EXPECT_EQ(after("voxloom: 1\nnodes:\n- id: a\n  type: t\n- id: b\n  type: t",
                    [](Document& d) { d.remove_node("b"); }),
              "voxloom: 1\nnodes:\n- id: a\n  type: t");
    // Windows line ends.
    EXPECT_EQ(
        after("voxloom: 1\r\nnodes:\r\n- id: a # c\r\n  type: t\r\n  set:\r\n    x: 1\r\n",
              [](Document& d) { d.set_param("a", "y", 0.5); }),
        "voxloom: 1\r\nnodes:\r\n- id: a # c\r\n  type: t\r\n  set:\r\n    x: 1\r\n    y: 0.5\r\n");
    // Everything in one line.
    EXPECT_EQ(
        after("{voxloom: 1, nodes: [{id: a, type: t}]}", [](Document& d) { d.add_node("b", "u"); }),
        "{voxloom: 1, nodes: [{id: a, type: t}, { id: b, type: u }]}");
    EXPECT_EQ(after("{voxloom: 1}", [](Document& d) { d.add_node("b", "u"); }),
              "{voxloom: 1, nodes: [{ id: b, type: u }]}");
    // Keys without values, or with empty ones.
    EXPECT_EQ(after("voxloom: 1\nnodes:\n- id: a\n  type: t\n  set:  # none\n  in: ~\n",
                    [](Document& d) { d.set_param("a", "x", true); }),
              "voxloom: 1\nnodes:\n- id: a\n  type: t\n  set: { x: true }  # none\n  in: ~\n");
    EXPECT_EQ(after("voxloom: 1\nnodes:\n- id: a\n  type: t\n  set: {}\n",
                    [](Document& d) { d.set_param("a", "x", true); }),
              "voxloom: 1\nnodes:\n- id: a\n  type: t\n  set: { x: true }\n");
    EXPECT_EQ(after("voxloom: 1\nnodes: # here\n", [](Document& d) { d.add_node("a", "t"); }),
              "voxloom: 1\nnodes: # here\n  - id: a\n    type: t\n");
    EXPECT_EQ(after("voxloom: 1\nnodes: [] # here\n", [](Document& d) { d.add_node("a", "t"); }),
              "voxloom: 1\nnodes: # here\n  - id: a\n    type: t\n");
    EXPECT_EQ(after("voxloom: 1 # one\n", [](Document& d) { d.add_node("a", "t"); }),
              "voxloom: 1 # one\nnodes:\n  - id: a\n    type: t\n");
    // Lists as lines.
    constexpr const char* lines =
        "voxloom: 1\nnodes:\n- id: a\n  type: t\n  set:\n    rows:  # pairs\n      - [0, 1]  # "
        "first\n"
        "      - [2, 3]\n    z: 1\n";
    EXPECT_EQ(after(lines,
                    [](Document& d) {
                        d.set_param("a", "rows", Rows{{0, 1}, {2, 5}});
                    }),
              replaced(lines, "[2, 3]", "[2, 5]"));
    EXPECT_EQ(after(lines,
                    [](Document& d) {
                        d.set_param("a", "rows", Rows{{0, 1}, {2, 3}, {4, 4}});
                    }),
              replaced(lines, "[2, 3]\n", "[2, 3]\n      - [4, 4]\n"));
    EXPECT_EQ(after(lines,
                    [](Document& d) {
                        d.set_param("a", "rows", Rows{{2, 3}});
                    }),
              replaced(lines, "      - [0, 1]  # first\n", ""));
    EXPECT_EQ(after(lines, [](Document& d) { d.set_param("a", "rows", Rows{}); }),
              replaced(lines, "rows:  # pairs\n      - [0, 1]  # first\n      - [2, 3]\n",
                       "rows: []  # pairs\n"));
    // Texts over several lines.
    EXPECT_EQ(
        after("voxloom: 1\nnodes:\n- id: a\n  type: t\n  set:\n    x: one\n      two # c\n    y: "
              "|\n      a\n\n      b\n"
              "    z: \"q\n      r\" # d\n",
              [](Document& d) {
                  Document::Step step(d);
                  d.set_param("a", "x", 1.0);
                  d.set_param("a", "y", 2.0);
                  d.set_param("a", "z", 3.0);
              }),
        "voxloom: 1\nnodes:\n- id: a\n  type: t\n  set:\n    x: 1 # c\n    y: 2\n    z: 3 # d\n");
    // A block text at the very end, which would gain a line break.
    EXPECT_EQ(after("voxloom: 1\nnodes:\n- id: a\n  type: |\n    t",
                    [](Document& d) { d.add_node("b", "u"); }),
              "voxloom: 1\nnodes:\n- id: a\n  type: t\n- id: b\n  type: u");
    // A key that goes from the line of the item's dash.
    EXPECT_EQ(after("voxloom: 1\nnodes:\n- set: { x: 1 }\n  id: a\n  type: t\n",
                    [](Document& d) { d.reset_param("a", "x"); }),
              "voxloom: 1\nnodes:\n- id: a\n  type: t\n");
    // A comment behind what stays, in braces over several lines.
    EXPECT_EQ(after("voxloom: 1\nnodes: [{ id: a, type: t, set: {\n  x: 1, # keep\n  y: 2 } }]\n",
                    [](Document& d) { d.reset_param("a", "y"); }),
              "voxloom: 1\nnodes: [{ id: a, type: t, set: {\n  x: 1, # keep\n   } }]\n");
}

TEST(DocumentEdit, KeepsWhetherANodeIsUsed) {
    constexpr const char* text = "voxloom: 1\nnodes:\n  - id: a  # first\n    type: t\n    set: { x: 1 }\n  - { id: b, type: t }\n";
    Document document = Document::parse(text);
    document.set_use({"a", "b"}, GraphNode::Use::bypassed);
    EXPECT_EQ(document.text(),
              "voxloom: 1\nnodes:\n  - id: a  # first\n    type: t\n    use: bypassed\n    set: { x: 1 }\n"
              "  - { id: b, type: t, use: bypassed }\n");
    document.set_use({"b"}, GraphNode::Use::disabled);
    EXPECT_EQ(Document::parse(document.text()).graph().nodes[1].use, GraphNode::Use::disabled);
    document.set_use({"a", "b"}, GraphNode::Use::normal);
    EXPECT_EQ(document.text(), text);
    document.undo();
    document.undo();
    document.undo();
    EXPECT_EQ(document.text(), text);
    EXPECT_THAT(refusal_of("voxloom: 1\nnodes: [{ id: a, type: t, use: never }]\n"), HasSubstr("'use' is 'never'; write bypassed"));
    EXPECT_THAT(refusal_of("voxloom: 1\nnodes: [{ id: a, type: t, use: [] }]\n"), HasSubstr("'use' is a list"));
}

TEST(DocumentEdit, KeepsWhatIsTheEditorsOwn) {
    constexpr const char* text = "editor: { zoom: 2, comments: [['an odd: one', 1, 2]] }  # mine\nvoxloom: 1\nnodes: []\n";
    Document document = Document::parse(text);
    ASSERT_EQ(document.graph().editor.size(), 2u);
    document.add_node("a", "t");
    EXPECT_EQ(document.graph().editor[1].yaml.items[0].items[0].text, "an odd: one");
    GraphParam::Yaml list{GraphParam::Yaml::Kind::list, {}, {}, {}};
    document.set_editor("comments", list);
    EXPECT_THAT(document.text(), ::testing::StartsWith("editor: { zoom: 2 }  # mine\n"));
    GraphParam::Yaml item{GraphParam::Yaml::Kind::quoted, "two\nlines", {}, {}};
    list.items = {item};
    document.set_editor("groups", list);
    document.set_editor("zoom", list);
    EXPECT_EQ(Document::parse(document.text()).graph().editor[1].yaml.items[0].text, "two\nlines");
    EXPECT_EQ(Document::parse(document.text()).graph().editor[0].key, "zoom") << "a key keeps its place";
    for (int i = 0; i < 4; ++i) document.undo();
    EXPECT_EQ(document.text(), text);
    // A new one goes to the end, whatever stands there.
    for (const char* other : {"voxloom: 1\nnodes:\n  - id: a\n    type: t\n", "{ voxloom: 1, nodes: [] }", "nodes: []\nvoxloom: 1"}) {
        Document added = Document::parse(other);
        added.set_editor("groups", list);
        EXPECT_EQ(Document::parse(added.text()).graph().editor.at(0).key, "groups") << added.text();
        added.set_editor("groups", {GraphParam::Yaml::Kind::list, {}, {}, {}});
        EXPECT_TRUE(added.graph().editor.empty());
        EXPECT_EQ(added.graph().nodes.size(), Document::parse(other).graph().nodes.size());
    }
    EXPECT_THAT(refusal_of("voxloom: 1\neditor: 7\n"), HasSubstr("'editor' is a single value"));
}

TEST(DocumentEdit, BreaksLinesThatWouldGrowTooLong) {
    Document document = Document::parse("voxloom: 1\nnodes:\n- id: a\n  type: t\n");
    for (int i = 0; i < 12; ++i)
        document.set_param("a", "parameter_" + std::to_string(i), std::string("value"));
    std::istringstream lines(document.text());
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100u) << line;
    EXPECT_EQ(document.graph().nodes[0].params.size(), 12u);
}

TEST(DocumentEdit, WritesEveryTextSoThatItReadsBack) {
    for (std::string text : {"",
                             "plain",
                             "12",
                             "1e5",
                             "true",
                             "Null",
                             "~",
                             "a: b",
                             "# no comment",
                             "- x",
                             "[1]",
                             "it's \"quoted\"",
                             "back\\slash",
                             "tab\tnew\nline\r",
                             " space ",
                             "\xc3\xa9\xe2\x82\xac",
                             "*x",
                             "&x",
                             "!x",
                             "%x",
                             "@x",
                             "`x",
                             "{",
                             "}",
                             ",",
                             "?",
                             "a,b",
                             "\x01\x7f"}) {
        Document document =
            Document::parse("voxloom: 1\nnodes: [{ id: a, type: t, set: { y: 1 } }]\n");
        document.set_param("a", "x", text);
        document.set_param("a", "list", std::vector<std::string>{text, text});
        const GraphNode node = Document::parse(document.text()).graph().nodes[0];
        EXPECT_EQ(node.params[1].yaml.text, text);
        EXPECT_EQ(node.params[2].yaml.items[1].text, text);
    }
}

TEST(DocumentEdit, RefusesWhatDoesNotApplyAndStaysAsItWas) {
    Document document = Document::parse(kGraph);
    auto refused = [&](auto edit) {
        std::string error = error_of([&] { edit(document); });
        EXPECT_EQ(document.text(), kGraph);
        EXPECT_FALSE(document.can_undo());
        return error;
    };
    EXPECT_EQ(refused([](Document& d) { d.add_node("ct", "t"); }),
              "there is a node 'ct' already; take another id");
    EXPECT_THAT(refused([](Document& d) { d.add_node("Big One", "t"); }),
                HasSubstr("'Big One' is no id"));
    EXPECT_THAT(refused([](Document& d) { d.add_node("x", ""); }), HasSubstr("needs a type"));
    EXPECT_EQ(refused([](Document& d) { d.remove_node("vieww"); }),
              "there is no node 'vieww'; did you mean 'view'?");
    EXPECT_THAT(refused([](Document& d) { d.rename_node("ct", "view"); }), HasSubstr("already"));
    EXPECT_THAT(refused([](Document& d) { d.set_param("no", "x", 1.0); }),
                HasSubstr("no node 'no'"));
    EXPECT_THAT(refused([](Document& d) { d.set_param("ct", "x", std::string("\xff")); }),
                HasSubstr("UTF-8"));
    EXPECT_THAT(refused([](Document& d) { d.connect("no", "x", "ct", "y"); }),
                HasSubstr("no node 'no'"));
    EXPECT_THAT(refused([](Document& d) { d.move_node("ct", {NAN, 0}); }), HasSubstr("'ct'"));
    EXPECT_THAT(refused([](Document& d) {
                    d.set_outputs({{"no", "x"}});
                }),
                HasSubstr("no node 'no'"));
    // What is so already is no step.
    EXPECT_EQ(refused([](Document& d) { d.set_param("orbit", "azimuth", std::int64_t(30)); }), "");
    EXPECT_EQ(refused([](Document& d) { d.disconnect("ct", "nothing"); }), "");
    EXPECT_EQ(refused([](Document& d) { d.reset_param("ct", "nothing"); }), "");
}

TEST(DocumentEdit, MakesOneStepOfSeveralInAScope) {
    Document document = Document::parse(kGraph);
    {
        Document::Step step(document);
        document.set_param("view", "step", 0.25);
        document.move_node("view", {0, 0});
        document.remove_node("ct");
    }
    document.set_param("view", "step", 0.125);
    document.undo();
    EXPECT_EQ(document.graph().find("ct"), nullptr);
    document.undo();
    EXPECT_EQ(document.text(), kGraph);
    EXPECT_FALSE(document.can_undo());
    document.redo();
    EXPECT_EQ(document.graph().find("ct"), nullptr);
    EXPECT_TRUE(document.can_redo());
    document.move_node("view", {5, 5});  // a new branch of the history
    EXPECT_FALSE(document.can_redo());
}

// Every place that messages name, in the order of the text.
std::string marks_of(const Graph& graph) {
    std::string text;
    auto add = [&](const Mark& mark) { text += std::to_string(mark.line) + ":" + std::to_string(mark.column) + " "; };
    std::function<void(const GraphParam::Yaml&)> add_yaml = [&](const GraphParam::Yaml& yaml) {
        add(yaml.mark);
        for (const auto& item : yaml.items) add_yaml(item);
    };
    auto add_params = [&](const std::vector<GraphParam>& params) {
        for (const GraphParam& param : params) add(param.mark), add_yaml(param.yaml);
    };
    for (const WireEnd& end : graph.outputs) add(end.mark);
    add_params(graph.editor);
    for (const GraphNode& node : graph.nodes) {
        add(node.mark), add(node.type_mark);
        for (const GraphInput& input : node.inputs) {
            add(input.mark);
            for (const WireEnd& end : input.from) add(end.mark);
        }
        add_params(node.params);
    }
    return text;
}

TEST(DocumentEdit, KeepsMarksWhereThingsStandWhateverIsReadAgain) {
    // Comments, several forms of nodes, block texts, and keys behind the nodes; edits that make lines more and fewer.
    const std::string text =
        "# begins\nvoxloom: 1\nnodes:\n  # the first\n  - id: a  # \u00fcber\n    type: t\n    set:\n      p: [1,\n        2]  # two\n"
        "  - { id: b, type: t, in: { x: a.out } }\n  -\n    type: t\n    id: c\n    set:\n      text: |\n        some > lines\n        | more\n"
        "  - id: d\n    type: t\neditor:\n  groups: [[G, a, b]]\noutputs: [a.out, d.out]\n";
    for (const char* newline : {"\n", "\r\n"}) {
        std::string with = text;
        for (std::size_t at = 0; *newline == '\r' && (at = with.find('\n', at)) != std::string::npos; at += 2) with.replace(at, 1, newline);
        Document document = Document::parse(with);
        std::vector<std::string> texts{document.text()};
        auto expect_marks = [&] { EXPECT_EQ(marks_of(document.graph()), marks_of(Document::parse(document.text()).graph())) << document.text(); };
        auto edit = [&](auto&& f) {
            f();
            texts.push_back(document.text());
            expect_marks();
        };
        edit([&] { document.set_param("a", "q", std::vector<double>(60, 0.125)); });
        edit([&] { document.reset_param("a", "p"); });
        edit([&] { document.move_nodes({{"a", {1, 2}}, {"b", {3, 4}}, {"d", {5, 6}}}); });
        GraphNode e, f;
        e.id = "e", f.id = "f", e.type = f.type = "t";
        edit([&] { document.add_nodes({e, f}); });
        edit([&] { document.connect("e", "out", "f", "x"); });
        edit([&] { document.remove_node("b"); });
        edit([&] { document.set_param("c", "text", std::string("short")); });
        edit([&] { document.remove_nodes({"c", "e"}); });
        edit([&] { document.rename_node("f", "g"); });
        edit([&] { document.set_param("g", "lines", std::string("a\nb\u00fc")); });
        edit([&] { document.remove_node("a"); });
        edit([&] { document.set_editor("groups", {}); });
        while (document.can_undo()) {
            document.undo();
            texts.pop_back();
            EXPECT_EQ(document.text(), texts.back());
            expect_marks();
        }
        while (document.can_redo()) {
            document.redo();
            expect_marks();
        }
    }
}

void expect_as_read_anew(const Document& document) {
    const Document anew = Document::parse(document.text());
    EXPECT_TRUE(same_content(document.graph(), anew.graph())) << document.text();
    EXPECT_EQ(marks_of(document.graph()), marks_of(anew.graph())) << document.text();
}

TEST(DocumentEdit, RemovesTheLastNodesHoweverTheTextEnds) {
    for (const std::string newline : {"\n", "\r\n"})
        for (const std::string& end : {std::string(), newline, std::string("  # the end")}) {
            auto lines = [&](std::initializer_list<const char*> all) {
                std::string text;
                for (const char* line : all) text += (text.empty() ? "" : newline) + line;
                return text + end;
            };
            const std::string text = lines({"voxloom: 1", "nodes:", "  - id: a", "    type: t", "  - id: b", "    type: t", "  - id: c", "    type: t",
                                            "  - { id: d, type: t, in: { x: c.out } }"});
            Document document = Document::parse(text);
            document.remove_nodes({"c", "d"});
            const std::string rest = lines({"voxloom: 1", "nodes:", "  - id: a", "    type: t", "  - id: b", "    type: t"});
            EXPECT_EQ(document.text(), end == newline ? rest : rest.substr(0, rest.size() - end.size()));
            ASSERT_EQ(document.graph().nodes.size(), 2u);
            expect_as_read_anew(document);
            document.undo();
            EXPECT_EQ(document.text(), text);
            expect_as_read_anew(document);
            document.remove_nodes({"b", "d"});
            expect_as_read_anew(document);
            document.remove_node("c");
            ASSERT_EQ(document.graph().nodes.size(), 1u);
            expect_as_read_anew(document);
        }
}

TEST(DocumentEdit, LeavesABlockTextAsItIsWhereTheNodeBehindGoes) {
    const std::string before = "voxloom: 1\nnodes:\n  - id: a\n    type: t\n    set:\n      text: ";
    for (const std::string block : {"|\n        x\n", ">\n        x\n", "|+\n        x\n\n", "|+\n        x\n\n\n"})
        for (const std::string behind : {"", "\n", "\n\n", "\n\n  - id: c\n    type: t", "\n  - id: c\n    type: t\n"}) {
            const std::string text = before + block + "  - id: b\n    type: t" + behind;
            Document document = Document::parse(text);
            auto value = [&] { return document.graph().find("a")->params.at(0).yaml.text; };
            const std::string was = value();
            document.remove_node("b");
            EXPECT_EQ(document.graph().find("b"), nullptr);
            EXPECT_EQ(value(), was) << text;
            expect_as_read_anew(document);
            document.undo();
            EXPECT_EQ(document.text(), text);
            expect_as_read_anew(document);
        }
}

// Documents share what they read until one of them changes it.
TEST(DocumentEdit, LeavesCopiesAsTheyAre) {
    Document document = Document::parse(kGraph);
    document.set_param("view", "step", 0.3);
    Document copy = document;
    document.undo();
    document.set_param("view", "step", 0.4);
    EXPECT_EQ(copy.graph().find("view")->params.back().yaml.text, Document::parse(copy.text()).graph().find("view")->params.back().yaml.text);
    const std::string before = copy.text();
    copy.undo();
    EXPECT_EQ(copy.text(), kGraph);
    copy.redo();
    EXPECT_EQ(copy.text(), before);
    EXPECT_EQ(marks_of(copy.graph()), marks_of(Document::parse(copy.text()).graph()));
}

// --- a long random sequence against a model
// ------------------------------------------------------------

TEST(DocumentEdit, FollowsAModelThroughTenThousandRandomEdits) {
    // What the graph should hold, kept apart from the document's own code.
    struct Node {
        std::map<std::string, std::string> params;               // as YAML
        std::map<std::string, std::vector<std::string>> inputs;  // node.port
        std::string at;
        bool operator==(const Node&) const = default;
    };
    struct Model {
        std::map<std::string, Node> nodes;
        std::vector<std::string> outputs;
        bool operator==(const Model&) const = default;
    };
    auto model_of = [](const Graph& graph) {
        std::function<std::string(const GraphParam::Yaml&)> text =
            [&](const GraphParam::Yaml& yaml) {
                double number;
                if (yaml.kind == GraphParam::Yaml::Kind::plain && parse_number(yaml.text, number))
                    return shortest(number);
                if (yaml.kind == GraphParam::Yaml::Kind::plain && yaml.text == "true")
                    return yaml.text;
                if (yaml.kind != GraphParam::Yaml::Kind::list)
                    return to_yaml(ParamValue(yaml.text));
                std::vector<std::string> items;
                for (const auto& item : yaml.items) items.push_back(text(item));
                return "[" + join(items, ", ") + "]";
            };
        Model model;
        for (const GraphNode& node : graph.nodes) {
            Node& n = model.nodes[node.id];
            for (const GraphParam& param : node.params) n.params[param.key] = text(param.yaml);
            for (const GraphInput& input : node.inputs)
                for (const WireEnd& end : input.from)
                    n.inputs[input.port].push_back(end.node + "." + end.port);
            if (node.at) n.at = shortest(node.at->x) + " " + shortest(node.at->y);
        }
        for (const WireEnd& end : graph.outputs) model.outputs.push_back(end.node + "." + end.port);
        return model;
    };

    for (const char* original :
         {kGraph, "voxloom: 1\nnodes: []",
          "{ voxloom: 1, # c\r\n nodes: [\r\n { id: a, type: t }, # x\r\n { id: b, type: t } ] }",
          "nodes:\n    # first\n-   type: t\n    in: {}\n    set:\n       p0: [1,\n 2]  # two\n"
          "       p1:\n       - 1\n       -\n         - 2\n    id: a\n#last\nvoxloom: 1\n"}) {
        Document document = Document::parse(original);
        Model model = model_of(document.graph());
        std::vector<Model> done, undone;
        std::vector<std::string> texts{original};  // after each step that is done
        std::uint64_t state = 12345;
        auto random = [&](std::uint64_t n) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            return (state >> 33) % n;
        };
        auto any_node = [&] {
            return std::next(model.nodes.begin(), std::ptrdiff_t(random(model.nodes.size())))
                ->first;
        };
        for (int i = 0; i < 2500; ++i) {
            std::uint64_t what = random(12);
            if (what == 0 && document.can_undo()) {
                document.undo();
                undone.push_back(model);
                model = done.back();
                done.pop_back();
                texts.pop_back();
                ASSERT_EQ(document.text(), texts.back());
                ASSERT_TRUE(model_of(document.graph()) == model);
                continue;
            }
            if (what == 1 && document.can_redo()) {
                document.redo();
                done.push_back(model);
                model = undone.back();
                undone.pop_back();
                texts.push_back(document.text());
                ASSERT_TRUE(model_of(document.graph()) == model);
                continue;
            }
            Model before = model;
            std::string text_before = document.text();
            if (model.nodes.size() < 2 || (what == 2 && model.nodes.size() < 5)) {
                std::string id = "n" + std::to_string(random(100000));
                if (model.nodes.count(id)) continue;
                document.add_node(id, "fake.add",
                                  random(2) ? std::optional(glm::dvec2(1, 2)) : std::nullopt);
                model.nodes[id].at = document.graph().find(id)->at ? "1 2" : "";
            } else if (what == 3 && random(2)) {
                std::string id = any_node();
                document.remove_node(id);
                model.nodes.erase(id);
                auto of_node = [&](const std::string& end) { return end.starts_with(id + "."); };
                std::erase_if(model.outputs, of_node);
                for (auto& [name, node] : model.nodes) {
                    for (auto& [port, ends] : node.inputs) std::erase_if(ends, of_node);
                    std::erase_if(node.inputs,
                                  [](const auto& input) { return input.second.empty(); });
                }
            } else if (what == 4) {
                std::string id = any_node(), to = "r" + std::to_string(random(100000));
                if (model.nodes.count(to)) continue;
                document.rename_node(id, to);
                auto node = model.nodes.extract(id);
                node.key() = to;
                model.nodes.insert(std::move(node));
                auto follow = [&](std::string& end) {
                    if (end.starts_with(id + ".")) end = to + end.substr(id.size());
                };
                for (std::string& end : model.outputs) follow(end);
                for (auto& [name, n] : model.nodes)
                    for (auto& [port, ends] : n.inputs)
                        for (std::string& end : ends) follow(end);
            } else if (what <= 6) {
                std::string id = any_node(), key = "p" + std::to_string(random(3));
                ParamValue value;
                switch (random(6)) {
                    case 0:
                        value = double(random(1000)) / 7;
                        break;
                    case 1:
                        value = std::vector<double>(random(4), double(random(9)));
                        break;
                    case 2:
                        value = Rows(random(3), std::vector<double>(random(3), 0.5));
                        break;
                    case 3:
                        value = std::string(random(3), "\n#'\"aX"[random(6)]);
                        break;
                    case 4:
                        value = std::vector<std::string>(random(3), "x y");
                        break;
                    default:
                        value = true;
                }
                document.set_param(id, key, value);
                model.nodes[id].params[key] = to_yaml(value);
            } else if (what == 7) {
                std::string id = any_node(), key = "p" + std::to_string(random(3));
                document.reset_param(id, key);
                model.nodes[id].params.erase(key);
            } else if (what <= 9) {
                std::string from = any_node(), to = any_node(),
                            port = "i" + std::to_string(random(2));
                bool append = random(2);
                document.connect(from, "out", to, port, append);
                auto& ends = model.nodes[to].inputs[port];
                if (!append) ends.clear();
                ends.push_back(from + ".out");
            } else if (what == 10) {
                std::string id = any_node(), port = "i" + std::to_string(random(2));
                document.disconnect(id, port);
                model.nodes[id].inputs.erase(port);
            } else if (random(2)) {
                std::string id = any_node();
                double x = double(random(1000)) / 3;
                document.move_node(id, {x, -x});
                model.nodes[id].at = shortest(x) + " " + shortest(-x);
            } else {
                std::vector<std::pair<std::string, std::string>> outputs;
                model.outputs.clear();
                for (std::uint64_t k = random(3); k > 0; --k) {
                    outputs.emplace_back(any_node(), "image");
                    model.outputs.push_back(outputs.back().first + ".image");
                }
                document.set_outputs(outputs);
            }
            ASSERT_TRUE(model_of(document.graph()) == model) << "edit " << i << "\n"
                                                             << text_before << "---\n"
                                                             << document.text();
            if (i % 16 == 0) {
                ASSERT_EQ(marks_of(document.graph()), marks_of(Document::parse(document.text()).graph()));
            }
            if (document.text() != text_before) {
                done.push_back(before);
                undone.clear();
                texts.push_back(document.text());
            }
        }
        EXPECT_TRUE(model_of(Document::parse(document.text()).graph()) == model);
        while (document.can_undo()) {
            document.undo();
            texts.pop_back();
            ASSERT_EQ(document.text(), texts.back());
        }
        EXPECT_EQ(document.text(), original);
        while (document.can_redo()) document.redo();
        EXPECT_TRUE(model_of(document.graph()) == (undone.empty() ? model : undone.front()));
    }
}

// --- files
// -----------------------------------------------------------------------------------------------

TEST(DocumentFile, SavesThroughATemporaryNameAndReadsBack) {
    testing::TempFolder folder;
    std::filesystem::path file = folder.path() / "g.yaml", link = folder.path() / "link.yaml";
    Document document = Document::parse(kGraph);
    document.set_param("view", "step", 0.3);
    document.save(file);
    EXPECT_EQ(document.graph().file, file);
    std::filesystem::create_symlink("g.yaml", link);
    Document again = Document::load(link);
    EXPECT_EQ(again.text(), document.text());
    again.set_param("view", "step", 0.4);
    again.save(link);
    EXPECT_TRUE(std::filesystem::is_symlink(link));
    EXPECT_EQ(Document::load(file).text(), again.text());
    std::size_t files = 0;
    for (auto& entry : std::filesystem::directory_iterator(folder.path())) files += entry.exists();
    EXPECT_EQ(files, 2u);
}

TEST(DocumentFile, LeavesNothingBehindWhereItCannotSave) {
    testing::TempFolder folder;
    Document document = Document::parse(kGraph);
    EXPECT_THAT(error_of([&] { document.save(folder.path() / "no" / "g.yaml"); }),
                HasSubstr("cannot be written"));
    std::filesystem::create_directories(folder.path() / "folder.yaml");
    EXPECT_THAT(error_of([&] { document.save(folder.path() / "folder.yaml"); }),
                HasSubstr("cannot be written"));
    std::size_t files = 0;
    for (auto& entry : std::filesystem::directory_iterator(folder.path())) files += entry.exists();
    EXPECT_EQ(files, 1u);
}

TEST(DocumentFile, WritesNumbersThatReadBackExactlyInEveryLocale) {
    // A locale with a decimal comma and grouped digits, made here since none may be installed.
    struct Comma : std::numpunct<char> {
        char do_decimal_point() const override { return ','; }
        char do_thousands_sep() const override { return '.'; }
        std::string do_grouping() const override { return "\3"; }
    };
    std::locale before = std::locale::global(std::locale(std::locale(), new Comma));
    bool c_locale = std::setlocale(LC_NUMERIC, "de_DE.UTF-8") != nullptr;  // where it is installed
    Document document = Document::parse(kGraph);
    for (double value : {0.1, 1e-5, 1234567.25, 1e300, -0.3, 123456789.0}) {
        document.set_param("view", "step", value);
        document.move_node("view", {value, value});
        const GraphNode node = Document::parse(document.text()).graph().nodes[1];
        double read = 0;
        EXPECT_TRUE(parse_number(node.params[1].yaml.text, read));
        EXPECT_EQ(read, value);
        EXPECT_EQ(node.at->x, value);
    }
    EXPECT_THAT(document.text(), HasSubstr("step: 123456789 "));
    std::locale::global(before);
    if (c_locale) std::setlocale(LC_NUMERIC, "C");
}

TEST(Document, addsSeveralNodesAsTheyAreInOneStep) {
    const Graph three = Document::parse(
        "voxloom: 1\nnodes:\n  - { id: a, type: t.t, set: { n: 012, w: 'on' }, at: [1, 2] }\n"
        "  - { id: b, type: t.t, in: { x: a.y, z: [a.y, c.y] } }\n  - { id: c, type: t.t }\n").graph();
    for (const char* text : {"voxloom: 1\nnodes: []\n", "voxloom: 1\nnodes:  # none yet\n", "voxloom: 1\n",
                             "{ voxloom: 1 }", "{ voxloom: 1, nodes: [] }",
                             "voxloom: 1\nnodes:\n  - { id: z, type: t.t }\n", "{ voxloom: 1, nodes: [{ id: z, type: t.t }] }"}) {
        Document document = Document::parse(text);
        Graph wanted = document.graph();
        wanted.nodes.insert(wanted.nodes.end(), three.nodes.begin(), three.nodes.end());
        document.add_nodes(three.nodes);
        EXPECT_TRUE(same_content(document.graph(), wanted)) << document.text();
        const std::string before = document.text();
        EXPECT_THAT(error_of([&] { document.add_nodes({three.nodes[1]}); }), HasSubstr("already"));
        EXPECT_EQ(document.text(), before);
        document.remove_nodes({"a", "c"});
        EXPECT_EQ(document.graph().find("b")->inputs.size(), 0u);
        document.undo();
        document.undo();
        EXPECT_EQ(document.text(), text);
        EXPECT_FALSE(document.can_undo());
    }
}

}  // namespace
}  // namespace voxloom
