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
// body(more) `count` times, and n times more for each more(n) that one of them calls: for work that begets work, which the bodies
// take from where they will. In any order, some at once.
void parallel_tasks(Context& context, std::size_t count, const std::function<void(const std::function<void(std::size_t)>& more)>& body);

} // namespace kiln
