// What this process has used so far.
#pragma once

namespace kiln {

double cpu_seconds();  // of all its threads, user and system
double peak_rss_mb();

} // namespace kiln
