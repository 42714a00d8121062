// Blocks of a pool: each its own, aligned, used again; what is given back is out of bounds where AddressSanitizer looks.
#include "compiler/bsp/pool.h"
#include <algorithm>
#include <array>
#include <cstdint>
#include <gtest/gtest.h>
#include <random>
#include <thread>

namespace kiln::bsp {
namespace {

TEST(Pool, BlocksAreTheirOwnAndKeepWhatIsWritten) {
    struct Block {
        std::uint32_t* at;
        std::size_t count;
        std::uint32_t mark;
    };
    Pool pool;
    std::mt19937 random(3);
    std::vector<Block> taken;
    for (std::uint32_t step = 0; step < 20000; ++step) {
        if (taken.empty() || random() % 5 < 3) {
            const std::size_t count = random() % 100 == 0 ? 100000 + random() % 300000 : 1 + random() % 600; // beyond the largest chunk too
            auto* const at = pool.take<std::uint32_t>(count);
            ASSERT_EQ(reinterpret_cast<std::uintptr_t>(at) % alignof(std::max_align_t), 0u);
            std::fill(at, at + count, step);
            taken.push_back({at, count, step});
        } else {
            std::swap(taken[random() % taken.size()], taken.back());
            const Block b = taken.back();
            taken.pop_back();
            for (std::size_t i = 0; i < b.count; ++i) ASSERT_EQ(b.at[i], b.mark);
            pool.give(b.at, b.count);
        }
        if (step % 5000 == 4999) pool.clear(), taken.clear();
    }
}

TEST(Pool, WhatIsGivenBackIsUsedAgain) {
    Pool pool;
    double* const first = pool.take<double>(20);
    pool.give(first, 20);
    EXPECT_EQ(pool.take<double>(18), first); // of the same class
    EXPECT_EQ(pool.take<double>(0), nullptr);
    pool.give<double>(nullptr, 0);
    char* const small = pool.take<char>(1); // less than the pointer of the free list
    pool.give(small, 1);
    EXPECT_EQ(pool.take<char>(3), small);
}

TEST(Pool, ClearedMemoryIsUsedAgain) {
    Pool pool;
    int* const first = pool.take<int>(1000);
    pool.take<int>(400000);
    pool.clear();
    EXPECT_EQ(pool.take<int>(1000), first);
}

// A pool a thread, as cutters have them; what is made is read by the one that waited for it.
TEST(Pool, ThreadsWithPoolsOfTheirOwnDoNotMeet) {
    struct Work {
        Pool pool;
        std::vector<std::pair<std::uint64_t*, std::size_t>> made;
        bool right = true;
    };
    std::array<Work, 4> works;
    {
        std::vector<std::jthread> threads;
        for (std::uint64_t t = 0; t < works.size(); ++t)
            threads.emplace_back([&work = works[t], t] {
                std::mt19937 random(static_cast<unsigned>(t));
                for (int step = 0; step < 5000; ++step) {
                    const std::size_t count = 1 + random() % 300;
                    auto* const at = work.pool.take<std::uint64_t>(count);
                    std::fill(at, at + count, t);
                    work.made.emplace_back(at, count);
                    if (step % 3 == 0) continue;
                    std::swap(work.made[random() % work.made.size()], work.made.back());
                    const auto [gone, size] = work.made.back();
                    work.right = work.right && std::all_of(gone, gone + size, [t](std::uint64_t x) { return x == t; });
                    work.made.pop_back();
                    work.pool.give(gone, size);
                }
            });
    }
    for (std::uint64_t t = 0; t < works.size(); ++t) {
        EXPECT_TRUE(works[t].right);
        EXPECT_GT(works[t].made.size(), 1000u);
        for (const auto& [at, count] : works[t].made) EXPECT_TRUE(std::all_of(at, at + count, [t](std::uint64_t x) { return x == t; }));
    }
}

#ifdef KILN_POOL_ASAN
TEST(PoolDeathTest, TouchingWhatWasGivenBackIsFound) {
    Pool pool;
    int* const p = pool.take<int>(8);
    p[7] = 1;
    EXPECT_DEATH(p[8] = 1, "use-after-poison"); // past what was asked for, within the block
    pool.give(p, 8);
    EXPECT_DEATH(p[0] = 1, "use-after-poison");
}
#endif

} // namespace
} // namespace kiln::bsp
