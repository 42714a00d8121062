#include "libs/core/process.h"
#include <sys/resource.h>

namespace kiln {
namespace {
rusage usage() {
    rusage u{};
    getrusage(RUSAGE_SELF, &u);
    return u;
}
} // namespace

double cpu_seconds() {
    const rusage u = usage();
    const auto seconds = [](timeval t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
    return seconds(u.ru_utime) + seconds(u.ru_stime);
}
double peak_rss_mb() { return static_cast<double>(usage().ru_maxrss) / 1024; }

} // namespace kiln
