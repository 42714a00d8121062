// The measurements as CSV, as a picture a scene, and as a page of all.
#pragma once
#include "tools/light_bench/measure.h"

namespace kiln::bench {

std::string light_csv(std::span<const Measurement> measurements);
// Error against CPU seconds, both axes logarithmic, of one scene. Filled marks: true error; hollow ones: what the method
// says of itself; faint ones: too close to the truth's own noise to tell; dashed lines: slope -1/2.
std::string light_svg(const std::string& scene, std::span<const Measurement> measurements);
std::string light_html(std::span<const std::string> scenes, std::span<const Measurement> measurements, const std::string& remark);

} // namespace kiln::bench
