#include "core/base/priority.h"

#include <sys/resource.h>
#include <unistd.h>

namespace voxloom {

// On Linux a priority belongs to a thread, whatever POSIX says, and a thread hands it on to those that it starts.
void give_way() {
    constexpr int kNice = 4;  // a little: beside other programs work must still get on
#ifdef __linux__
    setpriority(PRIO_PROCESS, id_t(gettid()), kNice);
#endif
}

}  // namespace voxloom
