// All methods on a scene, each at several settings; and the stored front that a run is held against.
#pragma once
#include "tools/light_bench/measure.h"

namespace kiln::bench {

struct SweepOptions {
    std::vector<double> targets = {20, 10, 5, 3, 2, 1, 0.5}; // of the bake, percent
    bool rivals = true;
    std::vector<std::string> methods;  // only these; empty: all
    std::uint32_t seeds = 1;           // bakes a target
    double most_cpu_s = 60;            // a finer setting is left out where it would take longer than this by the last two
    std::uint32_t most_lit = 1500;     // luxels at which rivals answer
};
std::vector<std::string> method_names();
// Calls `done` after each measurement.
void sweep(const LightScene& scene, const Truth& truth, const SweepOptions& options, Context& context, const std::function<void(const Measurement&)>& done);

// A front is kept in rays of the tracer, measured by the same process on the same scene, not in seconds: those of one machine
// are not those of another.
struct FrontPoint {
    std::string scene;
    double target = 0, error = 0; // percent
    double cost = 0;              // million rays of the tracer
};
// Without the points that another one beats in both.
std::vector<FrontPoint> pareto(std::span<const FrontPoint> points);
std::string write_front(std::span<const FrontPoint> front);
Result<std::vector<FrontPoint>> read_front(std::string_view text, const std::string& file);
// What the stored point's error costs now, over what it cost then. Points of the same scene count as they are where they are
// at least as good, and by the law of plain sampling (half the error, four times the cost) where they are worse, up to
// twice. Nothing: the scene was not measured, or not to such an error.
std::optional<double> cost_ratio(const FrontPoint& stored, std::span<const FrontPoint> now);

} // namespace kiln::bench
