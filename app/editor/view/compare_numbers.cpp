// What each of the compared branches costs and how wrong it is: measured here where no node of the graph does,
// and shown as a table.
#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "app/editor/view/compare_strip.h"
#include "core/base/text.h"

namespace voxloom::editor {

namespace {

using Against = Viewport::Against;

constexpr double kNames = 92, kColumn = 84, kWideColumn = 118;

// The image, as long as it is whole and of the graph as it is.
ImagePtr fresh_image(const Editor& editor, const WireEnd& port) {
    auto found = editor.live.values.find(port.node + "." + port.port);
    const ImagePtr* image = found == editor.live.values.end() || !found->second.fresh ? nullptr : std::get_if<ImagePtr>(&found->second.value);
    return image ? *image : nullptr;
}

std::shared_ptr<const void> address_of(const Value& value) {
    if (auto* volume = std::get_if<VolumePtr>(&value)) return *volume;
    if (auto* bricks = std::get_if<BricksPtr>(&value)) return *bricks;
    return nullptr;
}

// Only while nothing else runs, else it is stopped and begins anew at rest: it would take processors from the graph, what
// moves will be another one soon, and times would be those of a busy machine. In a sweep each value is soon followed
// by the next one, and waits only for what tells how wrong it is.
OwnMeasures measure(Editor& editor, const Branch& branch, const WireEnd& reference) {
    const bool idle = !editor.live.busy && !editor.moving && !editor.submitted_coarse, at_rest = idle && !editor.sweep;
    const bool decodes = idle && (!editor.sweep || (branch.codec == editor.sweep->node && needs_decoding(branch, editor.live)));
    OwnMeasures own;
    own.image_first = editor.viewport.against != Against::first;
    if (const Compared c = compared_of(branch, editor.live); c.bricks) {
        auto make = [c](const std::stop_token& stop) { return decode_all(c.bricks, c.original, stop); };
        const auto found = editor.decoded.find({c.bricks, address_of(c.original)}, decodes ? Background<Decoded>::Make(make) : nullptr);
        own.decoded = found.made;
        own.decoding = found.pending();
        own.decode_problem = found.made ? found.made->problem : found.problem;
    }
    const ImagePtr image = fresh_image(editor, branch.picture), other = fresh_image(editor, reference);
    if (!image || !other || !problem_with_comparison(image->size(), other->size()).empty()) return own;
    auto make = [image, other](const std::stop_token& stop) { return std::make_shared<const ImageError>(compare_images(*image, *other, stop)); };
    const auto found = editor.image_errors.find({image, other}, at_rest ? Background<ImageError>::Make(make) : nullptr);
    own.image = found.made;
    own.comparing = found.pending();
    own.image_problem = found.problem;
    return own;
}

std::string number(std::optional<double> v, int digits = 4) { return v ? fmt::format("{:.{}g}", *v, digits) : "–"; }
std::string seconds(std::optional<double> v) { return v ? human_seconds(*v) : "–"; }
std::string with(std::string text, bool wide, std::optional<double> v, const std::string& more) { return wide && v ? text + more : text; }

bool is_reference(const Editor& editor, std::size_t k) {
    return k < editor.references.size() && same_end(editor.references[k], editor.branches[k].picture);
}

// The columns' titles: a click makes a picture the one that the others are measured against.
void draw_title(Editor& editor, std::size_t k, ImVec2 at, double column) {
    const WireEnd& picture = editor.branches[k].picture;
    say_at(at, color_of_branch(k), (is_reference(editor, k) ? "= " : "") + picture.node, column - 6);
    ImGui::SetCursorScreenPos(at);
    ImGui::PushID(int(k));
    if (ImGui::InvisibleButton("reference", {ui(column - 6), ui(kStripLine)})) {
        editor.viewport.against = Against::port;
        editor.viewport.reference = picture;
    }
    ImGui::PopID();
    mark(editor, "reference:" + std::to_string(k));
    tooltip(is_reference(editor, k) ? "The others' image errors are against this picture." : "Click: image errors are against this picture.");
}

// The rows, with what their tooltips say.
constexpr std::pair<const char*, const char*> kRows[] = {
    {"ratio", "Bytes of the volume for each compressed byte, everything included."},
    {"bits per voxel", "Compressed bits a voxel, everything included."},
    {"PSNR, dB", "Of the decoded volume; the peak is the original's largest value minus its smallest."},
    {"max error", "The largest difference of a decoded voxel from the original."},
    {"image RMSE", "Of premultiplied RGBA from 0 to 1, and the largest difference: against the picture marked =, or as chosen."},
    {"encode", "The codec's own processor time where it tells it, else the time of its node."},
    {"decode", "Processor time of decoding all of it once, measured for this table."},
    {"frame", "The time of the picture's node."}};
static_assert(std::size(kRows) + 1 == std::size_t(kNumberRows));

// What a row means, and of a column what more is known: `own` is null beside the columns.
void explain(std::size_t row, const OwnMeasures* own, bool image_is_own) {
    std::string text = kRows[row].second;
    const bool image = kRows[row].first == std::string_view("image RMSE");
    if (own && !image && !own->decode_problem.empty()) text += "\nThe bricks cannot be decoded: " + own->decode_problem;
    if (own && image && !own->image_problem.empty()) text += "\nThe pictures cannot be compared: " + own->image_problem;
    if (own && image && image_is_own)
        text += fmt::format("\nPSNR {:.4g} dB, SSIM {:.5g}; {:.3g} % of the pixels are off by more than 1/255.", own->image->psnr, own->image->ssim,
                            100 * own->image->share_off);
    ImGui::SetTooltip("%s", text.c_str());
}

}  // namespace

std::vector<WireEnd> references_of(const Editor& editor, const std::vector<WireEnd>& pictures) {
    const Viewport& view = editor.viewport;
    std::vector<WireEnd> references;
    if (view.mode == Viewport::Mode::single || !view.numbers) return references;
    for (const WireEnd& picture : pictures) {
        switch (view.against) {
            case Against::first: references.push_back(pictures.front()); break;
            case Against::port: references.push_back(editor.work.graph().find(view.reference.node) ? view.reference : pictures.front()); break;
            case Against::uncompressed: {
                const bool coded = !branch_of(editor.work.graph(), editor.registry, picture).codec.empty();
                references.push_back({coded ? id_without_codec(picture.node) : picture.node, picture.port, {}});
            }
        }
    }
    return references;
}

void update_branches(Editor& editor) {
    auto same = [](const Branch& branch, const WireEnd& port) { return same_end(branch.picture, port); };
    if (editor.branches_text != editor.work.document.text() || !std::ranges::equal(editor.branches, editor.watched, same)) {
        editor.branches_text = editor.work.document.text();
        editor.branches.clear();
        for (const WireEnd& port : editor.watched) editor.branches.push_back(branch_of(editor.work.graph(), editor.registry, port));
    }
    editor.measures.assign(editor.branches.size(), {});
    for (std::size_t k = 0; k < std::min(editor.branches.size(), editor.references.size()); ++k)
        editor.measures[k] = measure(editor, editor.branches[k], editor.references[k]);
}

double numbers_width(std::size_t branches) { return kNames + (branches > 2 ? kColumn : kWideColumn) * double(branches); }

void draw_numbers(Editor& editor, ImVec2 lo) {
    auto row_at = [&](std::size_t row) { return lo.y + ui(kStripLine * double(row)); };
    // Of the row that the pointer is in, from the left edge of a column on.
    auto explain_in = [&](float x, double width, const OwnMeasures* own, bool image_is_own) {
        for (std::size_t r = 0; r < std::size(kRows); ++r)
            if (ImGui::IsWindowHovered() && ImGui::IsMouseHoveringRect({x, row_at(r + 1)}, {x + ui(width), row_at(r + 2)})) explain(r, own, image_is_own);
    };
    for (std::size_t r = 0; r < std::size(kRows); ++r) say_at({lo.x, row_at(r + 1)}, theme().muted, kRows[r].first, kNames - 6);
    explain_in(lo.x, kNames, nullptr, false);
    const bool wide = editor.branches.size() <= 2;
    const double column = wide ? kWideColumn : kColumn;
    for (std::size_t k = 0; k < editor.branches.size(); ++k) {
        const OwnMeasures& own = editor.measures[k];
        const BranchNumbers n = numbers_of(editor.branches[k], editor.live, own);
        const std::string image = is_reference(editor, k) && n.image_rmse == 0 ? "reference" : with(number(n.image_rmse, 3), wide, n.image_max, ", max " + number(n.image_max, 2));
        const std::string decode = with(seconds(n.decode), wide, n.decoded_bytes_per_second, ", " + number(n.decoded_bytes_per_second.value_or(0) * 1e-6, 3) + " MB/s");
        const std::string texts[] = {number(n.ratio), number(n.bits_per_voxel), number(n.psnr), number(n.max_error),
                                     n.image_rmse || !own.comparing ? image : "…", seconds(n.encode), n.decode || !own.decoding ? decode : "…", seconds(n.frame)};
        const float x = lo.x + ui(kNames + column * double(k));
        draw_title(editor, k, {x, lo.y}, column);
        for (std::size_t r = 0; r < std::size(texts); ++r) say_at({x, row_at(r + 1)}, theme().text, texts[r], column - 6);
        explain_in(x, column, &own, n.image_is_own);
    }
    mark(editor, "compare-table", lo, {lo.x + ui(numbers_width(editor.branches.size())), row_at(std::size(kRows) + 1)});
}

void draw_against(Editor& editor) {
    Viewport& view = editor.viewport;
    const bool chosen = view.against == Against::port && editor.work.graph().find(view.reference.node);
    const std::string now = view.against == Against::uncompressed ? "uncompressed" : chosen ? view.reference.node : "first picture";
    if (ImGui::Button(shortened("Against " + now, ui(150), theme().body, theme().body->FontSize).c_str())) ImGui::OpenPopup("against");
    mark(editor, "against");
    tooltip("What image errors are measured against.");
    if (!ImGui::BeginPopup("against")) return;
    auto choice = [&](const std::string& name, bool is_it, Against against, const WireEnd& port) {
        if (ImGui::Selectable(name.c_str(), is_it)) view.against = against, view.reference = port;
        mark(editor, "against:" + name);
    };
    choice("first picture", view.against == Against::first, Against::first, {});
    choice("uncompressed", view.against == Against::uncompressed, Against::uncompressed, {});
    tooltip("Of each picture the one without its codec: the same nodes draw the volume itself.");
    for (const WireEnd& port : ports_to_look_at(editor))
        if (makes_image(editor, port)) choice(port.node + "." + port.port, chosen && same_end(port, view.reference), Against::port, port);
    ImGui::EndPopup();
}

}  // namespace voxloom::editor
