// A table of one row, built value by value; numbers go into the run's report too.
#pragma once

#include <string>

#include "core/graph/node.h"

namespace voxloom::metrics {

class Row {
  public:
    Row(Evaluation& evaluation, const std::string& name) : evaluation_(evaluation) {
        table_.columns.push_back({"name", ""});
        table_.rows = {{name}};
    }
    Row& add(const std::string& column, double value, const std::string& unit = {}) {
        evaluation_.measure(column, value, unit);
        return put(column, value, unit);
    }
    Row& count(const std::string& column, std::uint64_t value, const std::string& unit = {}) {
        evaluation_.measure(column, double(value), unit);
        return put(column, std::int64_t(value), unit);
    }
    Row& text(const std::string& column, const std::string& value) { return put(column, value, {}); }
    TablePtr table() { return std::make_shared<Table>(std::move(table_)); }

  private:
    Row& put(const std::string& column, Table::Cell value, const std::string& unit) {
        table_.columns.push_back({column, unit});
        table_.rows.front().push_back(std::move(value));
        return *this;
    }
    Evaluation& evaluation_;
    Table table_;
};

}  // namespace voxloom::metrics
