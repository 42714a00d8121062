#include "libs/parallel/parallel.h"
#include <atomic>
#include <mutex>
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_for_each.h>
#include <tbb/task_arena.h>
#include <vector>

namespace kiln {

namespace {

// The caller's number holds even where it exceeds the machine's: results must not depend on it, and tests try.
template <class F> void on_threads(int threads, F&& body) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    arena.execute(body);
}

} // namespace

void parallel_for(Context& context, std::size_t count, const std::function<void(std::size_t)>& body) {
    context.check_cancelled();
    if (context.threads <= 1 || count <= 1) {
        for (std::size_t i = 0; i < count; ++i) {
            context.check_cancelled();
            body(i);
        }
        return;
    }
    on_threads(context.threads, [&] {
        tbb::parallel_for(
            tbb::blocked_range<std::size_t>(0, count, 1),
            [&](const tbb::blocked_range<std::size_t>& range) {
                for (std::size_t i = range.begin(); i != range.end(); ++i) {
                    context.check_cancelled();
                    body(i);
                }
            },
            tbb::simple_partitioner());
    });
}

void parallel_for(Context& context, const std::string& stage, std::size_t count,
                  const std::function<void(std::size_t)>& body) {
    if (!context.progress) return parallel_for(context, count, body);
    std::atomic<std::size_t> done{0};
    std::mutex gate;
    const std::size_t step = std::max<std::size_t>(1, count / 200);
    parallel_for(context, count, [&](std::size_t i) {
        body(i);
        const std::size_t now = ++done;
        if (now % step == 0 && gate.try_lock()) {
            context.say(stage, static_cast<double>(now) / static_cast<double>(count));
            gate.unlock();
        }
    });
}

void parallel_tasks(Context& context, std::size_t count, const std::function<void(const std::function<void(std::size_t)>& more)>& body) {
    context.check_cancelled();
    if (context.threads <= 1) {
        for (; count; --count) {
            context.check_cancelled();
            body([&](std::size_t n) { count += n; });
        }
        return;
    }
    on_threads(context.threads, [&] {
        std::vector<char> first(count);
        tbb::parallel_for_each(first.begin(), first.end(), [&](char, tbb::feeder<char>& feeder) {
            context.check_cancelled();
            body([&](std::size_t n) {
                for (std::size_t i = 0; i < n; ++i) feeder.add(0);
            });
        });
    });
}

} // namespace kiln
