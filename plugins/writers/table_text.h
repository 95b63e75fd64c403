// Tables as text.
#pragma once

#include <string>

#include "core/data/image.h"

namespace voxloom {

// RFC 4180: CRLF, fields quoted where they must be. The header names units in brackets: "time [s]".
// Numbers in their shortest exact form whatever the locale; nan, inf and -inf as these words.
std::string to_csv(const Table& table);

// {"columns": [{"name": ..., "unit": ...}], "rows": [[...], ...]}, a row a line. JSON has no NaN
// and no infinities: NaN is null, infinities are the texts "inf" and "-inf".
std::string to_json(const Table& table);

}  // namespace voxloom
