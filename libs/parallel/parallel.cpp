#include "libs/parallel/parallel.h"
#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_for_each.h>
#include <tbb/task_arena.h>
#include <vector>

#ifdef __SANITIZE_THREAD__
// Embree builds its trees with threads of its own, of which the sanitizer sees half.
extern "C" const char* __tsan_default_suppressions() { return "race:libembree3.so\nrace:libtbb.so\n"; }
#endif

namespace kiln {

namespace {

#ifdef __SANITIZE_THREAD__
// The library is not built for the thread sanitizer, which takes what its threads hand each other for races. Plain threads, then, so that
// what it reports is in the bodies. `work()` until it says there is none; the first exception ends all.
void on_plain_threads(int threads, const std::function<bool()>& work) {
    std::exception_ptr failed;
    std::mutex gate;
    std::atomic<bool> stop{false};
    std::vector<std::thread> team;
    for (int t = 0; t < threads; ++t)
        team.emplace_back([&] {
            try {
                while (!stop && work()) {}
            } catch (...) {
                const std::lock_guard lock(gate);
                if (!failed) failed = std::current_exception();
                stop = true;
            }
        });
    for (std::thread& t : team) t.join();
    if (failed) std::rethrow_exception(failed);
}
#else
// The caller's number holds even where it exceeds the machine's: results must not depend on it, and tests try.
template <class F> void on_threads(int threads, F&& body) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    arena.execute(body);
}
#endif

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
#ifdef __SANITIZE_THREAD__
    std::atomic<std::size_t> next{0};
    on_plain_threads(context.threads, [&] {
        const std::size_t i = next++;
        if (i >= count) return false;
        context.check_cancelled();
        body(i);
        return true;
    });
#else
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
#endif
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

namespace {
std::function<void(std::size_t)> of_chunk(std::size_t count, std::size_t size, const std::function<void(std::size_t, std::size_t)>& body) {
    return [=, &body](std::size_t chunk) { body(chunk * size, std::min(count, (chunk + 1) * size)); };
}
} // namespace

void parallel_chunks(Context& context, std::size_t count, std::size_t size, const std::function<void(std::size_t, std::size_t)>& body) {
    parallel_for(context, slots_of(count, size), of_chunk(count, size, body));
}

void parallel_chunks(Context& context, const std::string& stage, std::size_t count, std::size_t size, const std::function<void(std::size_t, std::size_t)>& body) {
    parallel_for(context, stage, slots_of(count, size), of_chunk(count, size, body));
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
#ifdef __SANITIZE_THREAD__
    std::atomic<std::size_t> waiting{count}, unfinished{count};
    on_plain_threads(context.threads, [&] {
        for (std::size_t n = waiting; n;) {
            if (!waiting.compare_exchange_weak(n, n - 1)) continue;
            context.check_cancelled();
            body([&](std::size_t more) { unfinished += more, waiting += more; });
            --unfinished;
            return true;
        }
        std::this_thread::yield();
        return unfinished > 0;
    });
#else
    on_threads(context.threads, [&] {
        std::vector<char> first(count);
        tbb::parallel_for_each(first.begin(), first.end(), [&](char, tbb::feeder<char>& feeder) {
            context.check_cancelled();
            body([&](std::size_t n) {
                for (std::size_t i = 0; i < n; ++i) feeder.add(0);
            });
        });
    });
#endif
}

} // namespace kiln
