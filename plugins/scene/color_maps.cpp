#include "plugins/scene/color_maps.h"

#include <algorithm>
#include <cassert>
#include <charconv>
#include <utility>

namespace voxloom::scene {

namespace {

// The perceptual maps are kept as 33 evenly spaced colours (RRGGBB), sampled from the published ones;
// read linearly they stay within 0.022 (cividis), 0.012 (plasma) or 0.008 (the others) of them.
//   viridis, plasma, inferno, magma  S. van der Walt and N. Smith 2015, CC0
//   cividis   J. Nunez, C. Anderton, R. Renslow, PLOS ONE 2018: also for the colour-blind
//   turbo     A. Mikhailov, Google 2019: a rainbow without false edges
//   coolwarm  K. Moreland, Diverging color maps for scientific visualization, 2009
constexpr std::string_view kViridis =
    "440154 470d60 48186a 482374 472d7b 453681 424086 3f4989 3b528b 375a8d 33638d 2f6a8e "
    "2c728e 297a8e 26818e 23898e 21908c 1f988b 1f9f88 21a685 28ae80 31b57b 3ebc74 4cc26c "
    "5dc963 6ece58 82d34c 96d83f abdc32 c0df24 d5e21a eae51a fde725";
constexpr std::string_view kPlasma =
    "0d0887 220690 310596 3f049c 4c02a1 5901a5 6600a7 7201a8 7e03a8 8909a6 9511a2 9f1a9c "
    "a92396 b22c8e bb3587 c33e80 cb4778 d25071 d9596a e06263 e66c5c eb7555 f07f4f f48a48 "
    "f89441 fb9f3a fdab33 feb72d fdc328 fcd025 f9dd25 f5eb27 f0f921";
constexpr std::string_view kInferno =
    "000004 040312 0b0724 150b37 210c4a 2e0a5a 3c0965 4a0c6b 57106d 63146e 70196e 7d1e6d "
    "89226a 962766 a32b61 af315c bb3755 c63e4d d14644 db4f3b e35932 eb6528 f1711e f67f14 "
    "f98d0a fb9c06 fcab0f fbba1f f9ca32 f5d949 f2e865 f3f586 fcffa4";
constexpr std::string_view kMagma =
    "000004 030311 0a0822 130d33 1d1146 28115a 36106a 430f76 50127c 5d177f 691c81 762181 "
    "822681 8f2a81 9c2e7f a9327d b63779 c33b75 cf4170 db486a e65163 ee5c5e f5695c f9785d "
    "fb8761 fd9668 fea571 feb47b fec387 fed194 fde0a2 fceeb0 fcfdbf";
constexpr std::string_view kCividis =
    "00224e 00285b 002e6a 043371 1a386f 273e6e 32436d 3b496c 434e6c 4b546c 52596d 5a5f6e "
    "61656f 686a71 6f7073 757676 7c7b78 848179 8b8778 938d78 9b9376 a39a75 aba072 b3a670 "
    "bbad6c c3b469 ccba64 d4c15f ddc958 e6d051 efd748 f8df3c fee838";
constexpr std::string_view kTurbo =
    "30123b 392a73 4040a1 4456c7 466be3 467ff6 4293ff 37a7fa 29bbec 1dcdd8 18dcc3 1ee8b0 "
    "31f299 4cf97e 6bfd64 8aff4d a3fd3c b8f735 cced34 dee037 edd03a f8c03a fdae35 fe982c "
    "fb8022 f56817 ec520f e04009 d23105 c02302 ac1701 950d01 7a0403";
constexpr std::string_view kCoolwarm =
    "3b4cc0 445acc 4d68d7 5775e1 6282ea 6c8ef1 779af7 82a5fb 8db0fe 98b9ff a3c2fe aec9fc "
    "b8d0f9 c2d5f4 ccd9ee d5dbe6 dddddd e5d8d1 ecd3c5 f1ccb9 f4c4ad f7bba0 f7b194 f7a687 "
    "f49a7b f18d6f ec7f63 e57058 de604d d55042 cb3e38 c0282f b40426";

ColorMap evenly(std::string_view hex) {
    ColorMap map;
    for (std::size_t i = 0; i + 6 <= hex.size(); i += 7) {
        unsigned rgb = 0;
        std::from_chars(hex.data() + i, hex.data() + i + 6, rgb, 16);
        map.knots.push_back({0, glm::dvec3(rgb >> 16, rgb >> 8 & 255, rgb & 255) / 255.0});
    }
    for (std::size_t i = 0; i < map.knots.size(); ++i)
        map.knots[i].position = double(i) / double(map.knots.size() - 1);
    return map;
}

// In the order in which people are shown them: those to prefer first.
const std::vector<std::pair<std::string, ColorMap>>& all_maps() {
    static const std::vector<std::pair<std::string, ColorMap>> maps = {
        {"viridis", evenly(kViridis)},
        {"plasma", evenly(kPlasma)},
        {"inferno", evenly(kInferno)},
        {"magma", evenly(kMagma)},
        {"cividis", evenly(kCividis)},
        {"turbo", evenly(kTurbo)},
        {"coolwarm", evenly(kCoolwarm)},
        {"gray", {{{0, {0, 0, 0}}, {1, {1, 1, 1}}}}},
        {"white", {{{0, {1, 1, 1}}, {1, {1, 1, 1}}}}},
        // A black body: red, then green, then blue rises.
        {"hot", {{{0, {0, 0, 0}}, {0.375, {1, 0, 0}}, {0.75, {1, 1, 0}}, {1, {1, 1, 1}}}}},
        // Gray seven eighths, with an eighth of reversed hot: the look of an X-ray film.
        {"bone", {{{0, {0, 0, 0}}, {0.375, {0.328125, 0.328125, 0.453125}},
                   {0.75, {0.65625, 0.78125, 0.78125}}, {1, {1, 1, 1}}}}},
        {"copper", {{{0, {0, 0, 0}}, {0.8, {1, 0.625, 0.398}}, {1, {1, 0.78125, 0.4975}}}}},
        // Flesh to bone, for heads and engines alike.
        {"flesh", {{{0, {0.25, 0.05, 0.03}}, {0.25, {0.72, 0.33, 0.24}}, {0.5, {0.9, 0.64, 0.5}},
                    {0.75, {0.96, 0.88, 0.76}}, {1, {1, 1, 0.97}}}}},
        // Hue around the colour circle. Has edges where the data has none; here because it is asked for.
        {"rainbow", {{{0, {0, 0, 1}}, {0.25, {0, 1, 1}}, {0.5, {0, 1, 0}}, {0.75, {1, 1, 0}},
                      {1, {1, 0, 0}}}}},
    };
    return maps;
}

}  // namespace

glm::dvec3 ColorMap::at(double t) const {
    auto next = std::upper_bound(knots.begin(), knots.end(), t,
                                 [](double v, const Knot& knot) { return v < knot.position; });
    if (next == knots.begin()) return knots.front().color;
    if (next == knots.end()) return knots.back().color;
    const Knot& before = *(next - 1);
    return glm::mix(before.color, next->color,
                    (t - before.position) / (next->position - before.position));
}

const std::vector<std::string>& color_map_names() {
    static const std::vector<std::string> names = [] {
        std::vector<std::string> list;
        for (const auto& [name, map] : all_maps()) list.push_back(name);
        return list;
    }();
    return names;
}

const ColorMap& color_map(std::string_view name) {
    for (const auto& [known, map] : all_maps())
        if (known == name) return map;
    assert(false && "no such colour map");
    return all_maps().front().second;
}

}  // namespace voxloom::scene
