// The editor's state, and the one function that draws a frame of it.
//
// Immediate mode: what is drawn follows from the state alone. Edits go through edit(), which turns a
// refusal into a message at the pointer; whatever the frame has changed is handed to the evaluator at
// its end. Everything here belongs to the thread that owns the window.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "app/editor/model/autosave.h"
#include "app/editor/model/background.h"
#include "app/editor/model/branch.h"
#include "app/editor/model/commands.h"
#include "app/editor/model/evaluator.h"
#include "app/editor/model/histogram.h"
#include "app/editor/model/kept.h"
#include "app/editor/model/knobs.h"
#include "app/editor/model/pick.h"
#include "app/editor/model/settings.h"
#include "app/editor/model/thumbnail.h"
#include "app/editor/view/theme.h"

namespace voxloom::editor {

// The whole graph, small, in the canvas' corner.
struct Minimap {
    glm::dvec2 lo{0.0}, size{0.0};  // on the screen
    glm::dvec2 all_lo{0.0};         // canvas coordinates of its upper left corner
    double scale = 1;               // pixels of the screen a canvas unit

    bool contains(glm::dvec2 p) const { return glm::all(glm::greaterThanEqual(p, lo)) && glm::all(glm::lessThan(p, lo + size)); }
    glm::dvec2 to_screen(glm::dvec2 p) const { return lo + (p - all_lo) * scale; }
    glm::dvec2 to_canvas(glm::dvec2 p) const { return all_lo + (p - lo) / scale; }
};

// The part of the canvas that is seen, and what the mouse is doing there.
struct Canvas {
    enum class Drag { none, pan, nodes, box, wire, map };
    glm::dvec2 pan{0.0};  // canvas coordinates of the upper left corner
    double zoom = 1;      // pixels (before scaling) a canvas unit
    bool fit_wanted = true;
    bool fitted = false;  // the whole graph is shown, and stays so when the window changes
    glm::dvec2 lo{0.0}, size{0.0};  // on the screen, of the last frame
    Drag drag = Drag::none;
    glm::dvec2 grabbed{0.0};  // canvas coordinates where the drag began
    glm::dvec2 held_at{0.0};  // place of what was grabbed there
    glm::dvec2 moved{0.0};    // by which the selected nodes are shown away from their places
    WireEnd wire;             // the port that a wire is drawn from
    bool wire_from_output = true;
    // The document's ports and boxes, made anew when its text has changed.
    std::string text = "-";
    std::vector<NodePorts> ports;
    std::vector<Group> groups;
    std::vector<Comment> comments;
    std::vector<NodeBox> boxes, group_boxes, comment_boxes;
    std::optional<Minimap> map;  // where not all of the graph is seen

    glm::dvec2 to_screen(glm::dvec2 p) const { return lo + (p - pan) * zoom * double(theme().scale); }
    glm::dvec2 to_canvas(glm::dvec2 p) const { return pan + (p - lo) / (zoom * double(theme().scale)); }
};

// The list to choose a new node from.
struct AddMenu {
    bool opened = false;
    glm::dvec2 at{0.0};       // canvas coordinates where the node goes
    std::string query;
    int chosen = 0;
    std::vector<Fit> fits;    // what fits the wire that was dropped; all nodes where there is no wire
    std::optional<WireEnd> end;
    bool end_is_output = true;
};

struct Picture {
    WireEnd port;              // an image or a table; empty: the next one that there is
    unsigned texture = 0;
    std::uint64_t serial = 0;  // of the value in the texture
    glm::ivec2 size{0};
};

struct Difference {
    Picture picture;
    double scale = 8;
    ImagePtr shown;            // in the texture
};

// What a node's thumbnail shows.
struct SmallPicture {
    Picture picture;
    std::shared_ptr<const Thumbnail> thumbnail;  // in the texture
    std::string problem;                         // why there is none of what flows now
};

// Pictures, alone or compared; all are moved and magnified together.
struct Viewport {
    enum class Mode { single, two, four, wipe, flicker, difference };
    Mode mode = Mode::single;
    std::array<Picture, 4> pictures;
    Difference difference;
    enum class Handle { none, move, turn } held = Handle::none;  // of the cutting plane
    // What errors of compared pictures are measured against: the first picture; one that was chosen, by a node that
    // makes it; or of each picture the one without its codec.
    enum class Against { first, port, uncompressed } against = Against::first;
    WireEnd reference;
    double wipe = 0.5;         // share of the width that shows the first picture
    bool numbers = true;       // shown below compared pictures
    double zoom = 0;           // screen pixels a picture pixel; 0: fitted
    glm::dvec2 offset{0.0};    // of the picture's middle from the viewport's, in screen pixels
};

// How the window is shared out: the graph to the left, pictures above parameters. What is compared gets more.
struct Split {
    float x = 0.6f, y = 0.5f;
};

struct FileDialog {
    enum class Purpose { open_graph, save_graph, parameter };
    Purpose purpose = Purpose::open_graph;
    bool opened = false;
    std::filesystem::path folder;
    std::string name;
    std::vector<std::filesystem::path> entries;  // of the folder; folders first
    std::string problem;                         // why they are not known
    std::function<void(const std::filesystem::path&)> chosen;
};

// The point of a transfer function that is in the hand, and the one that was last.
struct TransferEditor {
    std::string node;
    int dragged = -1, chosen = -1;
    bool gradients = false;                           // shown behind the function
    Picture picture{};                                // of them
    std::shared_ptr<const GradientHistogram> shown{};  // in the picture
};

// What the list of knobs was made of, and the list.
struct KnobList {
    std::string text;                   // of the document
    std::vector<std::string> selected;
    std::vector<WireEnd> shown;
    bool all = false;
    std::vector<Knob> knobs;
};

// The title or the comment that is typed.
struct NoteEditor {
    enum class Kind { none, group, comment };
    Kind kind = Kind::none;
    std::size_t index = 0;
    std::string text;
    bool opened = false;
};

// A thing on the screen with a name, for tests and other programs that look for it.
struct Mark {
    std::string name;
    ImVec2 lo, hi;
};

struct Editor {
    Editor(const Registry& registry, std::filesystem::path settings_file, std::function<void()> wake);

    const Registry& registry;
    std::filesystem::path settings_file;
    Settings settings;
    std::vector<Example> examples;

    Autosave autosave{autosave_folder()};
    std::vector<Recovered> recovered;  // of sessions that ended unexpectedly; asked for one by one
    bool ask_about_recovery = false;

    Workspace work;
    std::optional<Document::Step> drag_step;  // all edits of one drag are one step of undo
    Canvas canvas;
    AddMenu add;
    Viewport viewport;
    TransferEditor transfer;
    NoteEditor note;
    FileDialog files;
    bool start_page = true, show_help = false, show_problems = false, show_expert = false;
    std::function<void()> after_saving_asked;  // waits for the answer about unsaved changes
    bool ask_about_changes = false;
    std::filesystem::path overwriting;        // waits for the answer whether what is there may go
    std::string overwriting_destroys;         // in a sentence
    bool ask_about_overwriting = false;
    std::string id_text, id_of;               // the node's name while it is typed
    std::map<std::string, std::string> texts;  // of parameters while they are typed
    KnobList knobs;
    std::string copied;
    Split split_single{}, split_compared{0.45f, 0.62f};
    float split_large = 0.74f;
    bool large_picture = false;                // takes the graph's place, with the parameters beside it
    bool quit = false;
    bool theme_changed = false, screenshot_wanted = false, picture_wanted = false;

    std::string picked;         // what the pixel under the pointer shows, for the status line
    std::string message;        // a sentence at the pointer, until message_until
    double message_until = 0;
    bool message_is_error = false;

    std::vector<Branch> branches;  // of what is looked at
    std::vector<WireEnd> references;        // of each of them: the picture that it is measured against
    std::vector<OwnMeasures> measures;      // of each of them
    std::string branches_text;     // of the document that they were found in
    std::vector<Tried> tried;   // settings of codecs that were looked at, oldest first
    std::optional<Sweep> sweep; // in progress: evaluates other graphs than the document

    Graph submitted;            // as the evaluator has it
    std::string submitted_text; // of the document that was found to have the same results
    std::vector<WireEnd> watched;
    bool submitted_coarse = false, ever_submitted = false, moving = false;
    double moving_until = 0;    // a wheel that turns has no button to let go
    double next_change = 0;     // when the window changes by itself, in ImGui's seconds; see changes_at()
    std::filesystem::path output_folder = "out";

    std::map<std::string, SmallPicture> thumbnails;  // by port
    std::vector<unsigned> replaced_textures;    // their names are taken until a frame without them was drawn
    std::vector<double> frame_seconds;          // of the newest frames that changed something, a ring
    std::vector<double> frame_cpu_seconds;      // of the window's thread
    std::size_t frames_drawn = 0;

    std::vector<Mark> marks;
    bool marks_wanted = false;  // somebody reads them
    Evaluator::State live;
    Background<Histogram> histograms;
    Background<GradientHistogram> gradients;
    Background<Thumbnail> small_pictures;
    Background<Image> differences;
    Background<Decoded> decoded;
    Background<ImageError> image_errors;
    Background<Volume> loaded;  // one, whole, to be picked from
    // Where the pointer rests on a picture its volume is asked for in every frame. What had to be loaded whole for that waits
    // for it to come back, no longer than this; a window at rest looks every few seconds.
    Kept loaded_kept{30};
    Background<Picked> picks;   // few: the pointer soon is elsewhere
    Evaluator evaluator;        // the last: it ends first
};

void draw(Editor& editor);

// Runs f, which edits the document; what it throws is shown at the pointer.
void edit(Editor& editor, const std::function<void()>& f);
void say(Editor& editor, std::string message, bool error = false);
// What is drawn in this frame will be drawn otherwise from then on, also if nothing happens.
void changes_at(Editor& editor, double time);
void mark(Editor& editor, std::string name);  // the last item of ImGui
void mark(Editor& editor, std::string name, ImVec2 lo, ImVec2 hi);

const NodeStatus* status_of(const Editor& editor, const std::string& node);
// Images and tables, those that the graph is run for first.
std::vector<WireEnd> ports_to_look_at(const Editor& editor);
// What the viewport shows; fewer where there are not as many. Tables only where they were chosen, or alone where
// there is no image.
std::vector<WireEnd> shown_ports(const Editor& editor);
// How many pictures fit the mode.
std::size_t most_shown(Viewport::Mode mode);
bool makes_image(const Editor& editor, const WireEnd& port);
// The size of a port's image when nothing moves.
glm::ivec2 whole_size(const Editor& editor, const WireEnd& port, glm::ivec2 otherwise);

void close_drag_step(Editor& editor);
void begin_document(Editor& editor, Workspace work);
void new_graph(Editor& editor);
void open_graph(Editor& editor, const std::filesystem::path& file);
void save(Editor& editor);
void save_to(Editor& editor, const std::filesystem::path& file);  // whatever is there
void save_as(Editor& editor);
// Runs f now, or after the question whether the changes are to be saved.
void unless_changed(Editor& editor, std::function<void()> f);
void open_file_dialog(Editor& editor, FileDialog::Purpose purpose, const std::filesystem::path& at,
                      std::function<void(const std::filesystem::path&)> chosen);
void open_add_menu(Editor& editor, glm::dvec2 at);
void open_note(Editor& editor, NoteEditor::Kind kind, std::size_t index);
void fit_canvas(Editor& editor);
void submit_changes(Editor& editor);
void write_files(Editor& editor);

// The regions of the window, in the order in which they are drawn.
void draw_toolbar(Editor& editor);
void draw_canvas(Editor& editor);
void draw_add_menu(Editor& editor);
void draw_note_editor(Editor& editor);
void draw_viewport(Editor& editor);
// Of what is looked at: branches, and what the editor measures of them.
void update_branches(Editor& editor);
// For each of the pictures; empty where nobody sees the numbers.
std::vector<WireEnd> references_of(const Editor& editor, const std::vector<WireEnd>& pictures);
double compare_strip_height(const Editor& editor, double room);  // 0: there is none
void draw_compare_strip(Editor& editor, glm::dvec2 lo, glm::dvec2 size);
void draw_parameters(Editor& editor);
bool has_transfer_editor(const NodeType& type);
void draw_transfer_editor(Editor& editor, const std::string& id, const NodeType& type);
void draw_status_bar(Editor& editor);
void draw_start_page(Editor& editor);
void draw_dialogs(Editor& editor);
void draw_help(Editor& editor);

}  // namespace voxloom::editor
