#include "libs/core/checker.h"
#include "libs/core/check.h"

namespace kiln {

void Check::fail(Finding finding) {
    if (!collect_) throw InternalError(to_text(Diagnostic{Severity::error, code, std::move(finding.where), std::move(finding.message)}));
    ++failed;
    if (findings.size() < most_) findings.push_back(std::move(finding));
}

Checker Checker::collecting(std::size_t most) {
    Checker c;
    c.collect_ = true;
    c.most_ = most;
    return c;
}

std::uint64_t Checker::failures() const {
    std::uint64_t n = 0;
    for (const Check& c : checks_) n += c.failed;
    return n;
}

} // namespace kiln
