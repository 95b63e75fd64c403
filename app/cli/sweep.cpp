// A graph run once for each value of one parameter: camera paths, budgets, error bounds. Results are kept
// from run to run, so only what depends on the parameter is computed anew.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <utility>

#include "app/cli/commands.h"
#include "app/cli/files.h"
#include "app/cli/progress.h"
#include "app/cli/run_plan.h"
#include "app/cli/session.h"
#include "core/base/text.h"

namespace voxloom::cli {

namespace {

double number_in(std::string_view text, const std::string& option) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
        fail("--sweep {}: '{}' is no number; write NODE.PARAM=A..B or NODE.PARAM=A..B..STEP", option, text);
    return value;
}

struct Sweep {
    std::string parameter;  // NODE.PARAM
    std::vector<double> values;
};

Sweep parse_sweep(const std::string& text) {
    const std::size_t equals = text.find('=');
    const std::size_t dots = equals == std::string::npos ? equals : text.find("..", equals);
    if (dots == std::string::npos)
        fail("--sweep {}: write NODE.PARAM=A..B or NODE.PARAM=A..B..STEP", text);
    std::string_view rest = std::string_view(text).substr(dots + 2);
    const std::size_t more = rest.find("..");
    const double from = number_in(std::string_view(text).substr(equals + 1, dots - equals - 1), text);
    const double to = number_in(rest.substr(0, more), text);
    const double step = more == std::string_view::npos ? std::copysign(1.0, to - from)
                                                       : number_in(rest.substr(more + 2), text);
    const double steps = (to - from) / step;
    if (!(steps >= 0) || steps > 1e6)
        fail("--sweep {}: from {} to {} in steps of {} is no way to go", text, from, to, step);
    Sweep sweep{text.substr(0, equals), {}};
    // A last step that rounding has made a little too long counts.
    for (std::int64_t i = 0; i <= std::int64_t(steps + 1e-9); ++i) sweep.values.push_back(from + double(i) * step);
    return sweep;
}

struct Rarely {
    std::string node;
    int every;
};

std::vector<Rarely> parse_every(const std::vector<std::string>& texts) {
    std::vector<Rarely> all;
    for (const std::string& text : texts) {
        const std::size_t equals = text.find('=');
        int n = 0;
        const char* end = text.data() + text.size();
        if (equals == std::string::npos || std::from_chars(text.data() + equals + 1, end, n).ptr != end || n < 1)
            fail("--every {}: write NODE=N with N at least 1", text);
        all.push_back({text.substr(0, equals), n});
    }
    return all;
}

bool depends_on(const Plan& plan, int node, int other) {
    if (node == other) return true;
    for (const auto& port : plan.nodes[std::size_t(node)].inputs)
        for (const Plan::Source& source : port)
            if (source.node >= 0 && depends_on(plan, source.node, other)) return true;
    return false;
}

// One row a run; columns come as they are met.
class Rows {
  public:
    bool empty() const { return rows_.empty(); }
    void begin() { rows_.emplace_back(); }
    void add(const std::string& column, const std::string& value) {
        if (known_.insert(column).second) columns_.push_back(column);
        rows_.back()[column] = value;
    }
    void add(const std::string& column, double value) { add(column, shortest(value)); }
    std::string csv() const {
        std::string text;
        for (const std::string& column : columns_) text += (text.empty() ? "" : ",") + quoted(column);
        for (const auto& row : rows_) {
            text += "\n";
            bool first = true;
            for (const std::string& column : columns_) {
                if (!std::exchange(first, false)) text += ",";
                if (const auto it = row.find(column); it != row.end()) text += quoted(it->second);
            }
        }
        return text + "\n";
    }

  private:
    static std::string quoted(const std::string& s) {
        if (s.find_first_of(",\"\n") == std::string::npos) return s;
        std::string q = "\"";
        for (char c : s) q += c == '"' ? std::string("\"\"") : std::string(1, c);
        return q + "\"";
    }
    std::vector<std::string> columns_;
    std::set<std::string> known_;
    std::vector<std::map<std::string, std::string>> rows_;
};

// What every node did, but for the writers behind outputs.
void add_reports(Rows& rows, const Plan& plan, const RunResult& result, std::size_t nodes) {
    rows.add("seconds", result.wall_seconds);
    for (std::size_t i = 0; i < nodes; ++i) {
        const NodeReport& r = result.nodes[i];
        if (r.state != NodeState::done) continue;
        const std::string& id = plan.nodes[i].id;
        rows.add(id + " seconds", r.wall_seconds);
        rows.add(id + " cpu seconds", r.cpu_seconds);
        if (r.draw_seconds > 0) rows.add(id + " draw seconds", r.draw_seconds);
        for (const auto& [name, value] : r.counters) rows.add(id + " " + name, value);
        for (const auto& [name, m] : r.measurements)
            rows.add(id + " " + name + (m.second.empty() ? "" : " [" + m.second + "]"), m.first);
    }
}

}  // namespace

int sweep(const Document& document, const RunArguments& arguments, std::stop_token stop) {
    const Registry& registry = load_registry();
    const Sweep sweep = parse_sweep(arguments.sweep);
    const std::vector<Rarely> rarely = parse_every(arguments.every);
    ResultCache cache(std::uint64_t(arguments.cache_gib * double(1 << 30)));
    Rows rows;
    bool ok = true, cancelled = false;
    for (std::size_t step = 0; step < sweep.values.size() && ok; ++step) {
        std::vector<std::string> overrides = arguments.overrides;
        overrides.push_back(sweep.parameter + "=" + shortest(sweep.values[step]));
        Plan plan = voxloom::check(document.graph(), registry, {overrides, std::filesystem::current_path(), 0});
        for (const Problem& problem : plan.problems) fmt::print(stderr, "{}\n", problem.text(plan.file));
        ok = plan.problems.empty();
        if (!ok) break;
        select_outputs(plan, arguments.outputs);
        for (const Rarely& r : rarely) {
            const int node = node_named(plan, r.node, "--every");
            if (step % std::size_t(r.every) != 0)
                std::erase_if(plan.wanted, [&](const Plan::Source& s) { return depends_on(plan, s.node, node); });
        }
        const std::size_t nodes = plan.nodes.size();
        add_savers(plan, registry, fmt::format(".{:04}", step));

        RunOptions options;
        options.stop = stop;
        options.output_folder = arguments.out;
        options.threads = arguments.threads;
        ProgressLine progress(arguments.quiet);
        options.observer = &progress;
        const RunResult result = evaluate(plan, cache, options);
        print_messages(plan, result);
        ok = result.ok;
        cancelled = result.cancelled;
        rows.begin();
        rows.add("step", double(step));
        rows.add(sweep.parameter, sweep.values[step]);
        add_reports(rows, plan, result, nodes);
        fmt::print("{} of {}: {} = {} in {}\n", step + 1, sweep.values.size(), sweep.parameter,
                   shortest(sweep.values[step]), human_seconds(result.wall_seconds));
    }
    // What was measured before something went wrong is not lost.
    if (!rows.empty()) {
        const std::filesystem::path table = arguments.out / "sweep.csv";
        write_text_file(table, rows.csv());
        fmt::print("{}\n", table.string());
    }
    if (cancelled) {
        fmt::print(stderr, "voxloom: cancelled\n");
        return 130;
    }
    return ok ? 0 : 1;
}

}  // namespace voxloom::cli
