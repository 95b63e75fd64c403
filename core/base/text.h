// Small text helpers shared by messages, documents and reports.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace voxloom {

// The known name nearest to `wrong` by edit distance, or empty when none is near enough to suggest.
std::string nearest_name(std::string_view wrong, std::span<const std::string> known);
// "; did you mean 'x'?" or "" - to be appended to a message.
std::string did_you_mean(std::string_view wrong, std::span<const std::string> known);

// Shortest text that reads back as the same double, whatever the locale: "0.1", "1e-05", "inf".
std::string shortest(double value);
// Whole text must be a number; false otherwise. Locale-independent. Accepts .inf, -.inf, .nan (YAML).
bool parse_number(std::string_view text, double& value);
bool parse_integer(std::string_view text, std::int64_t& value);

std::string join(std::span<const std::string> parts, std::string_view separator);
std::string human_bytes(double bytes);      // "1.5 MiB"
std::string human_seconds(double seconds);  // "1.2 s", "3 min 20 s"

}  // namespace voxloom
