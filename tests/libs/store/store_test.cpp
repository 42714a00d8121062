#include "libs/core/file.h"
#include "libs/store/store.h"
#include <algorithm>
#include <filesystem>
#include <gtest/gtest.h>
#include <unistd.h>

using namespace kiln;

namespace {

struct Folder { // a fresh folder that goes away with the test
    std::string path = (std::filesystem::temp_directory_path() / ("kiln_store_" + std::to_string(::getpid()) + "_" +
                        ::testing::UnitTest::GetInstance()->current_test_info()->name())).string();
    Folder() { std::filesystem::remove_all(path); }
    ~Folder() { std::filesystem::remove_all(path); }
};
const Bytes kValue = [] {
    Bytes b(10000);
    for (std::size_t i = 0; i < b.size(); ++i) b[i] = static_cast<std::uint8_t>(mix(i / 16) & 15);
    return b;
}();

std::optional<Bytes> held(const ContentStore& store, Hash key, bool* damaged = nullptr) {
    const std::optional<Buffer> read = store.load(key, damaged);
    return read ? std::optional(Bytes(read->bytes().begin(), read->bytes().end())) : std::nullopt;
}

} // namespace

TEST(Store, GivesBackWhatWasSaved) {
    const Folder folder;
    const ContentStore store(folder.path);
    const Hash key{1, 2};
    EXPECT_FALSE(store.load(key).has_value());
    for (const bool compressed : {true, false}) {
        ASSERT_TRUE(store.save(key, kValue, compressed));
        EXPECT_EQ(held(store, key), kValue);
        EXPECT_EQ(std::filesystem::file_size(store.path(key)) < kValue.size(), compressed);
        ASSERT_TRUE(store.save(key, Bytes{}, compressed));
        EXPECT_EQ(held(store, key), Bytes{});
    }
}

// What was loaded stays what it was, whatever becomes of the file.
TEST(Store, WhatIsHeldOutlivesItsFile) {
    const Folder folder;
    const ContentStore store(folder.path);
    const Hash key{7, 8};
    for (const bool compressed : {true, false}) {
        ASSERT_TRUE(store.save(key, kValue, compressed));
        const auto first = store.load(key);
        ASSERT_TRUE(store.save(key, Bytes(kValue.size(), 3), compressed));
        const auto second = store.load(key);
        std::filesystem::remove_all(folder.path);
        ASSERT_TRUE(first && second);
        EXPECT_TRUE(std::ranges::equal(first->bytes(), kValue));
        EXPECT_TRUE(std::ranges::equal(second->bytes(), Bytes(kValue.size(), 3)));
    }
}

// A store may lose entries; it may never answer with anything but what was saved.
TEST(Store, EveryDamagedEntryIsAMiss) {
    const Folder folder;
    const ContentStore store(folder.path);
    const Hash key{3, 4};
    for (const bool compressed : {true, false}) {
        ASSERT_TRUE(store.save(key, kValue, compressed));
        const Bytes good = *read_file(store.path(key));
        for (std::size_t cut = 0; cut < good.size(); cut += 61) {
            ASSERT_TRUE(write_file(store.path(key), std::span(good).first(cut)));
            bool damaged = false;
            EXPECT_FALSE(store.load(key, &damaged).has_value()) << "cut at " << cut;
            EXPECT_TRUE(damaged);
        }
        for (std::size_t at = 0; at < good.size(); at += 13) {
            Bytes bad = good;
            bad[at] ^= 0x10;
            ASSERT_TRUE(write_file(store.path(key), bad));
            const auto read = held(store, key);
            EXPECT_TRUE(!read || *read == kValue) << "flipped at " << at;
        }
    }
}

TEST(Store, OfAnotherVersionIsAMissAndALieOfItsSizeIsDamage) {
    const Folder folder;
    const ContentStore store(folder.path);
    const Hash key{9, 9};
    ASSERT_TRUE(store.save(key, kValue));
    const Bytes good = *read_file(store.path(key));
    Bytes other = good;
    other[7] = '1';
    ASSERT_TRUE(write_file(store.path(key), other));
    bool damaged = false;
    EXPECT_FALSE(held(store, key, &damaged));
    EXPECT_FALSE(damaged);
    Bytes lies = good;
    std::fill_n(lies.begin() + 8, 8, std::uint8_t{255}), lies[8] = 254; // what zstd says of what is no frame of its
    std::fill_n(lies.begin() + 56, 4, std::uint8_t{0});
    ASSERT_TRUE(write_file(store.path(key), lies));
    EXPECT_FALSE(held(store, key, &damaged));
    EXPECT_TRUE(damaged);
}

TEST(Store, AnEntryUnderAnotherKeyIsAMiss) {
    const Folder folder;
    const ContentStore store(folder.path);
    ASSERT_TRUE(store.save({5, 6}, kValue));
    std::filesystem::create_directories(std::filesystem::path(store.path({7, 8})).parent_path());
    std::filesystem::copy_file(store.path({5, 6}), store.path({7, 8}));
    EXPECT_FALSE(store.load({7, 8}).has_value());
}

TEST(Store, UnwritableFolderFailsWithoutThrowing) {
    const ContentStore store("/proc/none");
    EXPECT_FALSE(store.save({1, 1}, kValue));
    EXPECT_FALSE(store.load({1, 1}).has_value());
}
