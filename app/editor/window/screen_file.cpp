#include "app/editor/window/screen_file.h"

#include <GL/gl.h>
#include <png.h>

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/base/error.h"
#include "core/base/output_file.h"
#include "core/measure/statistics.h"

namespace voxloom::editor {

namespace {

// Without what nobody has measured.
nlohmann::json numbers_to_json(const BranchNumbers& n) {
    nlohmann::json json = nlohmann::json::object();
    for (auto [name, value] : {std::pair("ratio", n.ratio), {"bits_per_voxel", n.bits_per_voxel}, {"psnr", n.psnr}, {"max_error", n.max_error},
                               {"image_rmse", n.image_rmse}, {"image_max", n.image_max}, {"encode", n.encode}, {"decode", n.decode}, {"frame", n.frame}})
        if (value) json[name] = *value;
    return json;
}

}  // namespace

std::string screen_to_json(const Editor& editor, bool resting) {
    nlohmann::json json;
    json["resting"] = resting;
    json["frame"] = ImGui::GetFrameCount();
    json["file"] = editor.work.file.string();
    json["changed"] = editor.work.changed();
    json["busy"] = editor.live.busy || editor.moving || editor.submitted_coarse;
    for (auto [name, times] : {std::pair("frame_seconds", &editor.frame_seconds), {"frame_cpu_seconds", &editor.frame_cpu_seconds}}) {
        std::vector<double> frames = *times;
        std::ranges::sort(frames);
        if (frames.empty()) continue;
        json[name]["median"] = quantile(frames, 0.5);
        json[name]["p99"] = quantile(frames, 0.99);
    }
    json["first_picture_seconds"] = editor.live.first_picture_seconds;
    json["run_seconds"] = editor.live.wall_seconds;
    json["message"] = editor.message;
    json["picked"] = editor.picked;
    json["selected"] = editor.work.selected;
    json["text"] = editor.work.document.text();
    json["shown"] = nlohmann::json::array();
    for (const WireEnd& end : editor.watched) json["shown"].push_back(end.node + "." + end.port);
    json["numbers"] = nlohmann::json::array();
    for (std::size_t k = 0; k < editor.measures.size(); ++k) json["numbers"].push_back(numbers_to_json(numbers_of(editor.branches[k], editor.live, editor.measures[k])));
    json["tried"] = editor.tried.size();
    json["sweeping"] = editor.sweep.has_value();
    json["problems"] = editor.live.problems.size();
    for (const auto& [id, status] : editor.live.nodes) json["states"][id] = name_of(status.state);
    for (const auto& [port, value] : editor.live.values)
        json["values"][port] = {{"serial", value.serial}, {"fresh", value.fresh}};
    for (const Mark& mark : editor.marks) json["items"][mark.name] = {mark.lo.x, mark.lo.y, mark.hi.x, mark.hi.y};
    return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void save_png(const std::filesystem::path& file, glm::ivec2 size, const std::vector<glm::u8vec4>& pixels) {
    png_image image;
    std::memset(&image, 0, sizeof image);
    image.version = PNG_IMAGE_VERSION;
    image.width = png_uint_32(size.x);
    image.height = png_uint_32(size.y);
    image.format = PNG_FORMAT_RGBA;
    png_alloc_size_t bytes = 0;
    std::vector<std::byte> encoded;
    bool fine = png_image_write_to_memory(&image, nullptr, &bytes, 0, pixels.data(), 0, nullptr);
    encoded.resize(fine ? bytes : 0);
    fine = fine && png_image_write_to_memory(&image, encoded.data(), &bytes, 0, pixels.data(), 0, nullptr);
    if (!fine) fail("{}: the picture cannot be encoded: {}", file.string(), image.message);
    std::filesystem::create_directories(file.parent_path());
    OutputFile out(file);
    out.write(std::span(encoded).first(bytes));
    out.commit();
}

void save_screenshot(const std::filesystem::path& file, int width, int height) {
    std::vector<glm::u8vec4> upwards(std::size_t(width) * std::size_t(height)), pixels;
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, upwards.data());
    pixels.reserve(upwards.size());
    for (int y = height; y-- > 0;)
        for (int x = 0; x < width; ++x) pixels.emplace_back(glm::u8vec3(upwards[std::size_t(y) * std::size_t(width) + std::size_t(x)]), 255);
    save_png(file, {width, height}, pixels);
}

}  // namespace voxloom::editor
