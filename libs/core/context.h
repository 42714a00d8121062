// Context: what a stage may use but what cannot change its result: threads, where diagnostics go, progress,
// the wish to stop. Passed in; there are no globals.
#pragma once
#include "libs/core/diagnostic.h"
#include <atomic>
#include <functional>
#include <stdexcept>
#include <utility>
#include <string>
#include <vector>

namespace kiln {

struct Cancelled : std::runtime_error {
    Cancelled() : std::runtime_error("cancelled") {}
};

class Context {
public:
    int threads = 1;
    // Called with (stage, done share 0..1); may be empty. Called from one thread at a time.
    std::function<void(const std::string& stage, double share)> progress;
    const std::atomic<bool>* stop = nullptr; // set by Ctrl-C

    // Diagnostics keep the order in which they are reported: report from the stage's own thread, in an order
    // that depends on the input alone (work in parallel collects by slot first).
    void report(Diagnostic diagnostic) { diagnostics_.push_back(std::move(diagnostic)); }
    void report(Severity severity, std::string code, std::string message, SourceLocation where = {}) {
        diagnostics_.push_back({severity, std::move(code), std::move(where), std::move(message)});
    }
    const std::vector<Diagnostic>& diagnostics() const { return diagnostics_; }
    std::vector<Diagnostic> take_diagnostics() { return std::exchange(diagnostics_, {}); }

    bool cancelled() const { return stop && stop->load(std::memory_order_relaxed); }
    void check_cancelled() const {
        if (cancelled()) throw Cancelled();
    }
    void say(const std::string& stage, double share) const {
        if (progress) progress(stage, share);
    }

private:
    std::vector<Diagnostic> diagnostics_;
};

} // namespace kiln
