#include "core/base/priority.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>

namespace voxloom {

// On Linux a priority belongs to a thread, whatever POSIX says, and a thread hands it on to those that it starts.
void give_way() {
#ifdef __linux__
    constexpr int kNice = 4;  // a little: beside other programs work must still get on
    const auto thread = id_t(gettid());
    setpriority(PRIO_PROCESS, thread, std::min(19, getpriority(PRIO_PROCESS, thread) + kNice));
#endif
}

}  // namespace voxloom
