#include <fmt/format.h>

#include <algorithm>

#include "core/base/text.h"
#include "plugins/metrics/nodes.h"

namespace voxloom::metrics {

namespace {

constexpr const char* kMethod = R"(
Puts the rows of several tables under each other: a column for each name and unit that any of them has,
in order of first appearance; what a table does not have stays empty. The column `name` comes first. It
says where a row is from: the name in `names`, else the table's own, else its number.

`layout: columns` turns the result around, with one line a measurement and one column a source: easier to
read for few sources and many measurements.
)";

bool same_column(const Table::Column& a, const Table::Column& b) {
    return a.name == b.name && a.unit == b.unit;
}

// Position of a column in the table, which is given it where it does not have it.
std::size_t column_in(Table& table, const Table::Column& column) {
    auto it = std::find_if(table.columns.begin(), table.columns.end(),
                           [&](const auto& c) { return same_column(c, column); });
    if (it == table.columns.end()) it = table.columns.insert(it, column);
    return std::size_t(it - table.columns.begin());
}

std::string text_of(const Table::Cell& cell) {
    if (auto* i = std::get_if<std::int64_t>(&cell)) return std::to_string(*i);
    if (auto* d = std::get_if<double>(&cell)) return shortest(*d);
    return std::get<std::string>(cell);
}

Table join(const std::vector<TablePtr>& tables, const std::vector<std::string>& names) {
    Table all;
    all.columns.push_back({"name", ""});
    for (std::size_t t = 0; t < tables.size(); ++t)
        for (const auto& row : tables[t]->rows) {
            std::vector<Table::Cell> joined(all.columns.size(), std::string());
            for (std::size_t c = 0; c < row.size(); ++c) {
                std::size_t at = column_in(all, tables[t]->columns[c]);
                joined.resize(all.columns.size(), std::string());
                joined[at] = row[c];
            }
            if (t < names.size())
                joined[0] = names[t];
            else if (text_of(joined[0]).empty())
                joined[0] = fmt::format("{}", t + 1);
            all.rows.push_back(std::move(joined));
        }
    for (auto& row : all.rows) row.resize(all.columns.size(), std::string());
    return all;
}

// Rows become columns: "measure", "unit", then one column for each row, named after its first cell.
Table turned(const Table& table) {
    Table result;
    result.columns = {{"measure", ""}, {"unit", ""}};
    for (const auto& row : table.rows) result.columns.push_back({text_of(row.front()), ""});
    for (std::size_t c = 1; c < table.columns.size(); ++c) {
        std::vector<Table::Cell> line{table.columns[c].name, table.columns[c].unit};
        for (const auto& row : table.rows) line.push_back(row[c]);
        result.rows.push_back(std::move(line));
    }
    return result;
}

void describe_node(Description& d) {
    const std::size_t names = d.params().texts("names").size(), tables = d.inputs("tables").size();
    if (names > 0 && names != tables)
        d.problem(fmt::format("there are {} names for {} tables; give each table one, or none", names,
                              tables), "names");
}

void evaluate_node(Evaluation& ev) {
    std::vector<TablePtr> tables;
    for (const Value& value : ev.values("tables")) tables.push_back(std::get<TablePtr>(value));
    Table table = join(tables, ev.params().texts("names"));
    if (ev.params().text("layout") == "columns") table = turned(table);
    ev.output("table", std::make_shared<Table>(std::move(table)));
}

}  // namespace

NodeType compare_node() {
    NodeType node;
    node.id = "metrics.compare";
    node.title = "Side by side";
    node.doc = "Joins tables of measurements into one, to compare where they are from.";
    node.keywords = {"table", "join", "compare", "report", "side by side"};
    node.inputs = {{"tables", PortType::table, "The tables, in order.", false, true}};
    node.outputs = {{"table", PortType::table, "All rows, under common columns."}};
    node.params = {
        param::texts("names", {}, "Names of the tables, in order; empty: their own."),
        param::choice("layout", {"rows", "columns"}, "rows",
                      "Whether each source is a row or a column.")};
    node.method = kMethod;
    node.describe = describe_node;
    node.evaluate = evaluate_node;
    return node;
}

}  // namespace voxloom::metrics
