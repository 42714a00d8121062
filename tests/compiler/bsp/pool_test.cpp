// Blocks of a pool: each its own, aligned, used again; what is given back is out of bounds where AddressSanitizer looks.
#include "compiler/bsp/pool.h"
#include <cstdint>
#include <gtest/gtest.h>
#include <random>

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
