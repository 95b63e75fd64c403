#include "plugins/scene/presets.h"

namespace voxloom::scene {

// The Hounsfield scale puts air at -1000 and water at 0; fat lies about -100, muscle at 40 to 60,
// blood with contrast agent at 150 to 400, spongy bone from 200, compact bone above 700.
const std::vector<Preset>& presets() {
    using Rgb = glm::dvec3;
    static const std::vector<Preset> all = {
        {"ct-bone", false,
         {{130, 0, Rgb(0.55, 0.25, 0.15)},
          {220, 0.06, Rgb(0.75, 0.45, 0.30)},
          {400, 0.35, Rgb(0.93, 0.85, 0.70)},
          {1000, 0.7, Rgb(1.00, 0.98, 0.92)},
          {3000, 0.9, Rgb(1.00, 1.00, 1.00)}}},
        {"ct-soft-tissue", false,
         {{-220, 0, Rgb(0.90, 0.75, 0.55)},
          {-100, 0.01, Rgb(0.90, 0.72, 0.50)},
          {-20, 0.02, Rgb(0.85, 0.55, 0.40)},
          {50, 0.10, Rgb(0.80, 0.36, 0.28)},
          {100, 0.12, Rgb(0.85, 0.45, 0.35)},
          {250, 0.25, Rgb(0.95, 0.82, 0.66)},
          {700, 0.6, Rgb(1.00, 0.97, 0.90)},
          {3000, 0.8, Rgb(1.00, 1.00, 1.00)}}},
        {"ct-lung", false,
         {{-920, 0, Rgb(0.25, 0.35, 0.65)},
          {-780, 0.015, Rgb(0.45, 0.60, 0.85)},
          {-550, 0.04, Rgb(0.75, 0.75, 0.80)},
          {-350, 0.03, Rgb(0.85, 0.55, 0.45)},
          {-150, 0, Rgb(0.80, 0.40, 0.30)},
          {250, 0, Rgb(0.95, 0.85, 0.75)},
          {500, 0.06, Rgb(0.95, 0.90, 0.80)}}},
        {"ct-vessels", false,
         {{110, 0, Rgb(0.60, 0.08, 0.06)},
          {170, 0.12, Rgb(0.75, 0.10, 0.08)},
          {300, 0.4, Rgb(0.90, 0.25, 0.18)},
          {450, 0.4, Rgb(0.95, 0.75, 0.60)},
          {1000, 0.7, Rgb(1.00, 0.97, 0.90)}}},
        // Magnetic resonance has no absolute unit: air is dark, scalp and white matter are bright.
        {"mr-head", true,
         {{0.10, 0, Rgb(0.40, 0.22, 0.18)},
          {0.18, 0.02, Rgb(0.60, 0.38, 0.30)},
          {0.35, 0.08, Rgb(0.82, 0.62, 0.50)},
          {0.55, 0.20, Rgb(0.93, 0.83, 0.74)},
          {1.00, 0.45, Rgb(1.00, 0.98, 0.95)}}},
    };
    return all;
}

const Preset* find_preset(std::string_view name) {
    for (const Preset& preset : presets())
        if (preset.name == name) return &preset;
    return nullptr;
}

}  // namespace voxloom::scene
