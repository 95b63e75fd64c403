// Work beside which people still want to be answered.
#pragma once

namespace voxloom {

// This thread, and whatever threads it starts from now on, run where the program's other threads leave a processor
// free. There is no way back. Where the system does not know of such a thing nothing changes.
void give_way();

}  // namespace voxloom
