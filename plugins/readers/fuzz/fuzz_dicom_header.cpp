// Any bytes walked as a DICOM file end in an Error or in values of bounded length.
#include <sstream>
#include <string>

#include "core/base/error.h"
#include "plugins/readers/dicom_header.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    // The first 132 bytes never change, so they are put before the input.
    std::istringstream in(std::string(128, '\0') + "DICM" +
                          std::string(reinterpret_cast<const char*>(data), size));
    try {
        voxloom::DicomHeader header = voxloom::parse_dicom_header(in, "fuzz.dcm");
        for (const auto& [tag, value] : header.values) {
            if (value.size() > 4096) __builtin_trap();
            header.numbers(tag, 3);
        }
    } catch (const voxloom::Error&) {
    }
    return 0;
}
