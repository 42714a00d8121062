// The stability suite: sweeps of one parameter until methods break, each with the range in which the bake must stay. Scenes are
// made in code; where a closed form or an exact reference exists, errors are against it.
//
// In       a sweep by its id
// Out      curves of the bake and, where the sweep is about how a method fails, of its rivals
// Errors   an unknown id: nothing
// What is swept, what came out and where each method breaks and why: compiler/light/STABILITY.md
#pragma once
#include "libs/core/context.h"
#include "tools/chart/chart.h"
#include <optional>
#include <string>
#include <vector>

namespace kiln::bench {

struct SweepSettings {
    bool quick = false; // a few points of the sweep
    bool rivals = true; // false: the bake alone
};
struct SweepReport {
    std::string id, title, range; // range: what is asked of the bake
    std::vector<Panel> panels;
    std::vector<std::string> notes; // what the curves do not show
};
struct SweepName {
    std::string id, title;
};
const std::vector<SweepName>& stability_sweeps();
std::optional<SweepReport> run_sweep(const std::string& id, const SweepSettings& settings, Context& context);

// The series of one method in a panel; nothing: it has none.
const Series* series_of(const Panel& panel, const std::string& name);

std::string stability_csv(const SweepReport& report); // panel, method, x, y
std::string stability_svg(const SweepReport& report);
std::string stability_html(const std::vector<SweepReport>& reports);

} // namespace kiln::bench
