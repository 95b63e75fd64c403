// What is kept while somebody uses it, and some seconds longer.
#pragma once

#include <limits>

namespace voxloom::editor {

// Seconds are those of any clock that goes forward.
struct Kept {
    double seconds = 0;  // how long it is kept after its last use
    double used = -std::numeric_limits<double>::infinity();

    void use(double now) { used = now; }
    // Before its first use, too.
    bool is_over(double now) const { return now > used + seconds; }
};

}  // namespace voxloom::editor
