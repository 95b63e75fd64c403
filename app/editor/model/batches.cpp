#include "app/editor/model/batches.h"

#include <algorithm>
#include <cmath>

namespace voxloom::editor {

namespace {

constexpr float kWorthABatch = 8000;  // pixels
constexpr float kEdges = 16;          // pixels that a triangle touches without covering them

struct Triangle {
    Batch::Kind kind = Batch::Kind::textured;
    float pixels = 0;
};

Triangle triangle_of(const DrawnList& list, const DrawnCommand& command, std::uint32_t at, const Letters& letters) {
    const DrawnVertex* v[3];
    for (std::uint32_t k = 0; k < 3; ++k) v[k] = &list.vertices[command.first_vertex + list.indices[command.first_index + at + k]];
    Triangle triangle;
    const glm::vec2 a = v[1]->position - v[0]->position, b = v[2]->position - v[0]->position;
    triangle.pixels = std::abs(a.x * b.y - a.y * b.x) / 2 + kEdges;
    if (command.texture != letters.texture) return triangle;
    if (std::ranges::any_of(v, [&](const DrawnVertex* one) { return one->texel != letters.white; })) return triangle;
    triangle.kind = ((v[0]->color & v[1]->color & v[2]->color) >> 24) == 255 ? Batch::Kind::opaque : Batch::Kind::plain;
    return triangle;
}

// Runs of one kind, each joined to the one before where too little would be gained by drawing it another way.
void add_batches(const DrawnList& list, std::uint32_t number, const DrawnCommand& command, const Letters& letters, std::vector<Batch>& batches) {
    float pixels = 0;  // of the last batch
    const std::size_t first = batches.size();
    for (std::uint32_t at = 0; at < command.count;) {
        Batch run{Batch::Kind::textured, command.clip, command.texture, number, command.first_vertex, command.first_index + at, 0};
        Triangle next = triangle_of(list, command, at, letters);
        run.kind = next.kind;
        float sum = 0;
        do {
            sum += next.pixels;
            run.count += 3;
            at += 3;
            if (at < command.count) next = triangle_of(list, command, at, letters);
        } while (at < command.count && next.kind == run.kind);
        const Batch* last = batches.size() > first ? &batches.back() : nullptr;
        if (!last || (run.kind != last->kind && (run.kind > last->kind ? sum : pixels) >= kWorthABatch)) {
            batches.push_back(run);
            pixels = sum;
        } else {
            batches.back().kind = std::min(batches.back().kind, run.kind);
            batches.back().count += run.count;
            pixels += sum;
        }
    }
}

}  // namespace

std::vector<Batch> batches_of(const std::vector<DrawnList>& lists, const Letters& letters) {
    std::vector<Batch> batches;
    for (std::uint32_t i = 0; i < lists.size(); ++i)
        for (const DrawnCommand& command : lists[i].commands) add_batches(lists[i], i, command, letters, batches);
    return batches;
}

}  // namespace voxloom::editor
