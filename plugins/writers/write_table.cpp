// writers.table: rows of measurements to CSV and JSON.
#include <fmt/format.h>

#include "core/graph/node.h"
#include "core/base/output_file.h"
#include "plugins/writers/table_text.h"
#include "plugins/writers/writers.h"

namespace voxloom {

void add_table_writer(Registry& registry) {
    NodeType type;
    type.id = "writers.table";
    type.title = "Write table";
    type.doc = "Writes a table of measurements as CSV or JSON.";
    type.keywords = {"save", "export", "file", "csv", "json", "measurements", "report"};
    type.inputs = {{"table", PortType::table, "The table to write."}};
    type.params = {param::path_out("path", "table.csv",
                                   "The file; its extension is the format: .csv or .json.")};
    type.writes_files = true;
    type.method =
        R"(CSV as RFC 4180 has it, units in the header (`time [s]`), numbers in their shortest exact form
whatever the locale, `nan`, `inf` and `-inf` as these words. JSON holds the columns with their units
and the rows as lists; NaN is `null`, infinities are texts.)";
    type.describe = [](Description& d) {
        const std::filesystem::path path = d.params().path("path");
        const std::string extension = extension_of(path);
        if (extension != ".csv" && extension != ".json")
            d.problem(fmt::format("'{}' has none of the extensions .csv and .json", path.string()),
                      "path");
    };
    type.evaluate = [](Evaluation& e) {
        const TablePtr table = e.input<Table>("table");
        const std::filesystem::path path = e.output_path("path");
        check_stop(e.stop());
        OutputFile file(path);
        file.write(extension_of(path) == ".csv" ? to_csv(*table) : to_json(*table));
        file.commit();
    };
    registry.add(std::move(type));
}

}  // namespace voxloom
