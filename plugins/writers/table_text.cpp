#include "plugins/writers/table_text.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/base/text.h"

namespace voxloom {

namespace {

std::string csv_field(const std::string& text) {
    if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
    std::string quoted = "\"";
    for (char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
    return quoted + "\"";
}

std::string csv_number(double v) {
    if (std::isnan(v)) return "nan";
    if (std::isinf(v)) return v > 0 ? "inf" : "-inf";
    return shortest(v);
}

std::string csv_cell(const Table::Cell& cell) {
    if (auto* i = std::get_if<std::int64_t>(&cell)) return std::to_string(*i);
    if (auto* d = std::get_if<double>(&cell)) return csv_number(*d);
    return csv_field(std::get<std::string>(cell));
}

// Bytes that are not UTF-8 become the replacement character; JSON can hold nothing else.
std::string dump(const nlohmann::ordered_json& json) {
    return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

nlohmann::ordered_json json_cell(const Table::Cell& cell) {
    if (auto* i = std::get_if<std::int64_t>(&cell)) return *i;
    if (auto* d = std::get_if<double>(&cell)) {
        if (std::isnan(*d)) return nullptr;
        if (std::isinf(*d)) return csv_number(*d);
        return *d;
    }
    return std::get<std::string>(cell);
}

}  // namespace

std::string to_csv(const Table& table) {
    std::string text;
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
        const Table::Column& column = table.columns[c];
        text +=
            (c ? "," : "") +
            csv_field(column.unit.empty() ? column.name : column.name + " [" + column.unit + "]");
    }
    text += "\r\n";
    for (const auto& row : table.rows) {
        for (std::size_t c = 0; c < row.size(); ++c) text += (c ? "," : "") + csv_cell(row[c]);
        text += "\r\n";
    }
    return text;
}

std::string to_json(const Table& table) {
    auto columns = nlohmann::ordered_json::array();
    for (const Table::Column& column : table.columns)
        columns.push_back({{"name", column.name}, {"unit", column.unit}});
    std::string text = "{\"columns\": " + dump(columns) + ",\n\"rows\": [";
    for (std::size_t r = 0; r < table.rows.size(); ++r) {
        auto row = nlohmann::ordered_json::array();
        for (const Table::Cell& cell : table.rows[r]) row.push_back(json_cell(cell));
        text += (r ? ",\n " : "\n ") + dump(row);
    }
    return text + "\n]}\n";
}

}  // namespace voxloom
