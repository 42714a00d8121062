#include "libs/core/archive.h"
#include "libs/core/held.h"
#include "libs/core/check.h"
#include "libs/core/file.h"
#include "libs/core/hash.h"
#include "libs/core/index.h"
#include "libs/parallel/parallel.h"
#include <filesystem>
#include <gtest/gtest.h>
#include <mutex>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>

using namespace kiln;

namespace {
struct Inner {
    std::string name;
    std::vector<double> values;
    template <class A> void fields(A& a) { a(name, values); }
    friend bool operator==(const Inner&, const Inner&) = default;
};
struct Outer {
    std::uint8_t small = 0;
    bool flag = false;
    std::optional<Inner> maybe;
    std::vector<Inner> many;
    std::array<Index<struct T>, 2> ids;
    std::vector<bool> bits;
    template <class A> void fields(A& a) { a(small, flag, maybe, many, ids, bits); }
    friend bool operator==(const Outer&, const Outer&) = default;
};
const Outer kSample{7, true, Inner{"a", {1, 2}}, {{"b", {}}, {"c", {-0.0, 3}}}, {id<Index<struct T>>(4)}, {true, false, true}};
} // namespace

TEST(Archive, DecodesWhatItEncoded) { EXPECT_EQ(from_bytes<Outer>(to_bytes(kSample)), kSample); }

TEST(Archive, EveryTruncationIsAnError) {
    const Bytes bytes = to_bytes(kSample);
    for (std::size_t n = 0; n < bytes.size(); ++n)
        EXPECT_THROW(from_bytes<Outer>(std::span(bytes).first(n)), ArchiveError) << n;
    Bytes longer = bytes;
    longer.push_back(0);
    EXPECT_THROW(from_bytes<Outer>(longer), ArchiveError);
}

TEST(Archive, AVectorIsReadWhereItLies) {
    const Held<std::uint64_t> wide(std::vector<std::uint64_t>{1, 2, 3});
    const Held<std::uint8_t> narrow(std::vector<std::uint8_t>{7});
    ByteWriter w;
    w(wide, narrow, wide);
    EXPECT_EQ(from_bytes<std::vector<std::uint64_t>>(to_bytes(wide)), (std::vector<std::uint64_t>{1, 2, 3}));
    const auto file = std::make_shared<const std::vector<std::uint64_t>>(w.bytes.size() / 8 + 1); // aligned
    std::memcpy(const_cast<std::uint64_t*>(file->data()), w.bytes.data(), w.bytes.size());
    const auto* at = reinterpret_cast<const std::uint8_t*>(file->data());
    ByteReader r(std::span(at, w.bytes.size()));
    const Held<std::uint64_t> again(r.view<std::uint64_t>(), file);
    EXPECT_TRUE(std::ranges::equal(again, wide));
    EXPECT_EQ(static_cast<const void*>(&again[0]), at + 8);
    EXPECT_EQ(r.view<std::uint8_t>()[0], 7);
    EXPECT_THROW((void)r.view<std::uint64_t>(), ArchiveError); // after a single byte
    ByteReader cut(std::span(at, 16));
    EXPECT_THROW((void)cut.view<std::uint64_t>(), ArchiveError);
}

TEST(Archive, AHostileLengthAllocatesNothing) {
    const Bytes bytes = to_bytes(std::uint64_t{1} << 60);
    EXPECT_THROW(from_bytes<std::vector<double>>(bytes), ArchiveError);
    EXPECT_THROW(from_bytes<std::string>(bytes), ArchiveError);
}

TEST(Diagnostic, StartsWithFileAndLineSoThatEditorsCanJump) {
    const Diagnostic d{Severity::error, "plane-collinear", {"maps/x.map", 214, 0, 37, 4}, "the plane points are collinear"};
    EXPECT_EQ(to_text(d), "maps/x.map:214: error: entity 0, brush 37, side 4: the plane points are collinear [plane-collinear]");
}

TEST(Parallel, EachItemRunsOnceOnAnyNumberOfThreads) {
    for (const int threads : {1, 2, 7}) {
        Context context;
        context.threads = threads;
        std::vector<int> hits(1000);
        parallel_for(context, hits.size(), [&](std::size_t i) { ++hits[i]; });
        EXPECT_EQ(hits, std::vector<int>(1000, 1));
        std::vector<std::size_t> slots(slots_of(hits.size(), 64));
        parallel_chunks(context, hits.size(), 64, [&](std::size_t first, std::size_t last) {
            for (std::size_t i = first; i < last; ++i) ++hits[i];
            slots[first / 64] += last - first;
        });
        EXPECT_EQ(hits, std::vector<int>(1000, 2));
        std::vector<std::size_t> expected(16, 64);
        expected.back() = 40;
        EXPECT_EQ(slots, expected);
        parallel_chunks(context, 0, 64, [&](std::size_t, std::size_t) { ADD_FAILURE(); });
    }
}

// Each number begets the two that halve it.
TEST(Parallel, WorkThatBegetsWorkIsAllDone) {
    for (const int threads : {1, 2, 7}) {
        Context context;
        context.threads = threads;
        std::mutex gate;
        std::vector<int> waiting{1000, 500, 77};
        std::atomic<int> ones{0};
        parallel_tasks(context, waiting.size(), [&](const std::function<void(std::size_t)>& more) {
            const std::unique_lock lock(gate);
            const int n = waiting.back();
            waiting.pop_back();
            if (n == 1) return void(++ones);
            waiting.insert(waiting.end(), {n / 2, n - n / 2});
            more(2);
        });
        EXPECT_EQ(ones, 1577);
        EXPECT_TRUE(waiting.empty());
        EXPECT_THROW(parallel_tasks(context, 3, [](const auto&) { throw std::runtime_error("x"); }), std::runtime_error);
        std::atomic<bool> stop{false};
        context.stop = &stop;
        EXPECT_THROW(parallel_tasks(context, 3, [&](const std::function<void(std::size_t)>& more) { stop = true, more(1); }), Cancelled);
    }
}

TEST(Parallel, CancellingAndThrowingEndTheLoop) {
    std::atomic<bool> stop{true};
    for (const int threads : {1, 3}) {
        Context context;
        context.threads = threads;
        EXPECT_THROW(parallel_for(context, 100, [](std::size_t i) { if (i == 50) throw std::runtime_error("x"); }),
                     std::runtime_error);
        context.stop = &stop;
        EXPECT_THROW(parallel_for(context, 100, [](std::size_t) {}), Cancelled);
    }
}

TEST(File, AFailedWriteLeavesNothingBehind) {
    const std::string folder = (std::filesystem::temp_directory_path() / "kiln_file_test").string();
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    EXPECT_FALSE(write_file(folder + "/none/x", "text"));
    EXPECT_FALSE(write_file(folder, "a folder cannot be replaced"));
    const auto full = write_file("/dev/full", "text");
    ASSERT_FALSE(full);
    EXPECT_EQ(full.fault().exit, Exit::io);
    EXPECT_TRUE(write_file(folder + "/x", "text"));
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1);
    EXPECT_FALSE(std::filesystem::exists(folder + ".tmp"));
    std::filesystem::remove_all(folder);
}

TEST(Check, NamesBothValues) {
    try {
        KILN_CHECK_OP(1 + 1, ==, 3);
        FAIL();
    } catch (const InternalError& e) { EXPECT_NE(std::string(e.what()).find("2 against 3"), std::string::npos); }
}

// A pipe says nothing of how much will come.
TEST(File, IsReadWhole) {
    const std::string path = (std::filesystem::temp_directory_path() / ("kiln_file_" + std::to_string(::getpid()))).string();
    for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{65536}, std::size_t{300001}}) {
        Bytes bytes(size);
        for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(mix(i));
        ASSERT_TRUE(write_file(path, bytes));
        EXPECT_EQ(*read_file(path), bytes);
        std::filesystem::remove(path);
        ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
        std::thread writer([&] { EXPECT_TRUE(write_file(path, bytes)); });
        EXPECT_EQ(*read_file(path), bytes) << "of a pipe";
        writer.join();
        std::filesystem::remove(path);
    }
    EXPECT_FALSE(read_file(path));
    EXPECT_FALSE(read_file("/"));
}
