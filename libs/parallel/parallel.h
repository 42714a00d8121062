// Work in parallel whose result does not depend on how many threads did it: item i writes slot i, sums run over
// chunks of fixed size added in index order. Bodies that throw, and Ctrl-C, end the loop with an exception.
#pragma once
#include "libs/core/context.h"
#include <cstddef>
#include <functional>

namespace kiln {

// body(i) for i in [0, count), each exactly once, on context.threads threads.
void parallel_for(Context& context, std::size_t count, const std::function<void(std::size_t)>& body);
// The same with progress reported under `stage` as items finish.
void parallel_for(Context& context, const std::string& stage, std::size_t count,
                  const std::function<void(std::size_t)>& body);
// body(first, last) for [first, last) of every `size` items of [0, count), the last run of them shorter: for small items, and those that share scratch or a
// slot (number first / size, of slots_of(count, size)).
void parallel_chunks(Context& context, std::size_t count, std::size_t size, const std::function<void(std::size_t, std::size_t)>& body);
void parallel_chunks(Context& context, const std::string& stage, std::size_t count, std::size_t size, const std::function<void(std::size_t, std::size_t)>& body);
constexpr std::size_t slots_of(std::size_t count, std::size_t size) { return (count + size - 1) / size; }
// body(more) `count` times, and n times more for each more(n) that one of them calls: for work that begets work, which the bodies
// take from where they will. In any order, some at once.
void parallel_tasks(Context& context, std::size_t count, const std::function<void(const std::function<void(std::size_t)>& more)>& body);

} // namespace kiln
