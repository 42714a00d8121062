// Laws of the whole way: the cache and the thread count change nothing, edits redo what depends on them and no more.
#include "tests/support/program.h"
#include "compiler/compile.h"
#include <set>

using namespace kiln;
using namespace kiln::test;

namespace {

struct Build {
    Bytes level;
    std::set<std::string> made; // stages that ran
    std::vector<Diagnostic> diagnostics;
};
Build bake(const std::string& text, const ContentStore& store, int threads = 2, double luxel_error = 10) {
    CompileInput input;
    input.map = {"test.map", Bytes(text.begin(), text.end())};
    CompileOptions options;
    options.light.error_percent = 20;
    options.ambient.error_percent = 40;
    options.density.error_percent = luxel_error;
    Context context;
    context.threads = threads;
    Compiled out;
    CompileRun run;
    run.store = &store;
    const auto done = compile(input, options, run, context, out);
    EXPECT_TRUE(done) << (done ? "" : to_text(done.fault().diagnostic));
    Build b{out.level, {}, context.diagnostics()};
    for (const StageReport& s : out.stages)
        if (!s.cached) b.made.insert(s.name);
    return b;
}
const std::set<std::string> kNeverKept = {"read", "world", "pack"};

std::string two_rooms(const std::string& more = "") {
    return world(room(128, 96, 80) + box(60, 0, 0, 68, 40, 80) + box(60, 56, 0, 68, 96, 80) + box(60, 40, 48, 68, 56, 80)) +
           entity("light", 30, 48, 60, "\"light\" \"300\"\n") + entity("info_player_start", 100, 48, 24) + more;
}

} // namespace

TEST(Bake, ThreadsAndCacheChangeNoByte) {
    const Workplace w;
    const ContentStore none(""), store(w.path("cache"));
    const Build one = bake(two_rooms(), none, 1);
    ASSERT_FALSE(one.level.empty());
    for (const int threads : {2, 7}) EXPECT_EQ(bake(two_rooms(), none, threads).level, one.level) << threads;
    const Build cold = bake(two_rooms(), store), warm = bake(two_rooms(), store);
    EXPECT_EQ(cold.level, one.level);
    EXPECT_EQ(warm.level, one.level);
    EXPECT_EQ(warm.made, kNeverKept);
    ASSERT_EQ(warm.diagnostics.size(), cold.diagnostics.size()); // a warm build warns of what the cold one did
    for (std::size_t i = 0; i < cold.diagnostics.size(); ++i) EXPECT_EQ(to_text(warm.diagnostics[i]), to_text(cold.diagnostics[i]));
}

TEST(Bake, AnEntityThatLightsNothingRedoesNoGeometryVisOrLight) {
    const Workplace w;
    const ContentStore store(w.path("cache"));
    bake(two_rooms(), store);
    const std::string edited = two_rooms("{\n\"classname\" \"trigger_relay\"\n\"targetname\" \"x\"\n}\n");
    const Build b = bake(edited, store);
    EXPECT_EQ(b.made, kNeverKept);
    EXPECT_EQ(b.level, bake(edited, ContentStore("")).level);
}

// Entities are asked only whether they are sealed in, and that costs no stage.
TEST(Bake, MovingThePlayerStartInsideItsRoomRedoesNothing) {
    const Workplace w;
    const ContentStore store(w.path("cache"));
    const auto with_start_at = [](double x, double y, double z) {
        std::string text = two_rooms();
        text.resize(text.find("{\n\"classname\" \"info_player_start\""));
        return text + entity("info_player_start", x, y, z);
    };
    const Build first = bake(two_rooms(), store);
    const std::string edited = with_start_at(110, 40, 30);
    const Build b = bake(edited, store);
    EXPECT_EQ(b.made, kNeverKept);
    EXPECT_NE(b.level, first.level); // it says where the start is
    EXPECT_EQ(b.level, bake(edited, ContentStore("")).level);
    // Through the door: the same region, the same light; only the probe that nobody placed may have to look again.
    const std::string other = with_start_at(20, 20, 30);
    const Build c = bake(other, store);
    for (const char* stage : {"csg", "bsp", "visibility", "surfaces", "light", "ambient"}) EXPECT_FALSE(c.made.contains(stage)) << stage;
    EXPECT_EQ(c.level, bake(other, ContentStore("")).level);
}

// Light, cubes and charts that come out the same are taken over from the bake before, and the bytes are those of a clean build.
TEST(Bake, ALightEditedOnAWarmCacheGivesTheBytesOfACleanBuild) {
    const Workplace w;
    const ContentStore store(w.path("cache"));
    bake(two_rooms(), store);
    const auto lit = [](const char* more) { return two_rooms(more); };
    const std::string brighter = [] {
        std::string text = two_rooms();
        return text.replace(text.find("\"300\""), 5, "\"360\"");
    }();
    for (const std::string& edited : {brighter, lit("{\n\"classname\" \"light\"\n\"origin\" \"100 20 40\"\n\"light\" \"120\"\n}\n"), two_rooms()})
        for (const double luxel_error : {10.0, 0.0}) {
            const Build b = bake(edited, store, 2, luxel_error);
            EXPECT_EQ(b.level, bake(edited, ContentStore(""), 1, luxel_error).level);
            for (const char* stage : {"csg", "bsp", "visibility", "surfaces"}) EXPECT_FALSE(b.made.contains(stage)) << stage;
        }
}

// The leak test is no part of what the cache keeps: an edit that lets the void in is found on a warm cache.
TEST(Bake, AStartMovedIntoTheVoidIsALeakOnAWarmCache) {
    const Workplace w;
    const ContentStore store(w.path("cache"));
    bake(two_rooms(), store);
    const std::string lost = two_rooms(entity("info_null", 3000, 0, 0));
    CompileInput input;
    input.map = {"test.map", Bytes(lost.begin(), lost.end())};
    CompileRun run;
    run.store = &store;
    run.last = Stage::bsp;
    CompileOptions options;
    {
        Context context;
        Compiled out;
        const auto done = compile(input, options, run, context, out);
        ASSERT_FALSE(done);
        EXPECT_EQ(done.fault().diagnostic.code, "leak");
        EXPECT_TRUE(out.leak);
        ASSERT_FALSE(out.stages.empty());
        EXPECT_TRUE(out.stages.back().cached);
    }
    options.bsp.allow_leaks = true;
    Context context;
    Compiled out;
    ASSERT_TRUE(compile(input, options, run, context, out));
    EXPECT_TRUE(out.leak);
    for (const BspLeaf& l : out.bsp.leaves) EXPECT_FALSE(l.outside);
}

// Messages of a stage that comes from the cache name the lines of the map as it is now.
TEST(Bake, MessagesOfAWarmCacheNameTodaysLines) {
    const Workplace w;
    const ContentStore store(w.path("cache"));
    const auto told = [](const std::string& map, const ContentStore* from) {
        CompileInput input;
        input.map = {"test.map", Bytes(map.begin(), map.end())};
        CompileRun run;
        run.store = from;
        run.last = Stage::surfaces;
        Context context;
        Compiled out;
        EXPECT_TRUE(compile(input, {}, run, context, out));
        std::vector<std::string> lines;
        for (const Diagnostic& d : context.diagnostics()) lines.push_back(to_text(d));
        return lines;
    };
    const std::string camera = entity("sky_camera", -8, 48, 24); // in the wall
    const std::string patch = "{\n\"classname\" \"func_group\"\n{\npatchDef2\n{\nwall\n( 3 3 0 0 0 )\n(\n( ( 9 9 9 0 0 ) ( 9 9 9 0 1 ) ( 9 9 9 0 2 ) )\n( ( 9 9 9 1 0 ) ( 9 9 9 1 1 ) ( 9 9 9 1 2 ) )\n( ( 9 9 9 2 0 ) ( 9 9 9 2 1 ) ( 9 9 9 2 2 ) )\n)\n}\n}\n}\n";
    const std::string before = two_rooms(camera + patch), after = two_rooms(entity("info_null", 32, 32, 24) + camera + patch);
    const auto first = told(before, &store), warm = told(after, &store), cold = told(after, nullptr);
    EXPECT_NE(first, cold);
    EXPECT_EQ(warm, cold);
    EXPECT_TRUE(std::ranges::any_of(cold, [](const std::string& line) { return line.find("sky-camera") != std::string::npos; }));
    EXPECT_TRUE(std::ranges::any_of(cold, [](const std::string& line) { return line.find("patch") != std::string::npos; }));
}

TEST(Bake, ALightEditRedoesLightAndWhatFollows) {
    const Workplace w;
    const ContentStore store(w.path("cache"));
    const Build first = bake(two_rooms(), store);
    std::string edited = two_rooms();
    edited.replace(edited.find("\"300\""), 5, "\"250\"");
    const Build b = bake(edited, store);
    for (const char* stage : {"csg", "bsp", "visibility", "surfaces"}) EXPECT_FALSE(b.made.contains(stage)) << stage;
    EXPECT_TRUE(b.made.contains("light"));
    EXPECT_NE(b.level, first.level);
    EXPECT_EQ(b.level, bake(edited, ContentStore("")).level);
    EXPECT_EQ(bake(two_rooms(), store).level, first.level); // undo
}

TEST(Bake, OtherLuxelsAreChosenWithoutLightingAnew) {
    const Workplace w;
    const ContentStore store(w.path("cache"));
    const Build fine = bake(two_rooms(), store, 2, 0), coarse = bake(two_rooms(), store, 2, 10);
    std::set<std::string> redone = kNeverKept;
    redone.insert("density");
    EXPECT_EQ(coarse.made, redone);
    EXPECT_LT(coarse.level.size(), fine.level.size());
    EXPECT_EQ(coarse.level, bake(two_rooms(), ContentStore("")).level);
}

TEST(Bake, APoisonedCacheIsNoticed) {
    const Workplace w;
    const ContentStore store(w.path("cache"));
    const Build first = bake(two_rooms(), store);
    std::size_t n = 0;
    for (const auto& e : std::filesystem::recursive_directory_iterator(w.path("cache")))
        if (e.is_regular_file()) {
            std::fstream f(e.path(), std::ios::in | std::ios::out | std::ios::binary);
            f.seekp(static_cast<std::streamoff>(e.file_size() * 3 / 4));
            f.put('\x5a');
            if (++n % 2) std::filesystem::resize_file(e.path(), e.file_size() / 2);
        }
    EXPECT_GE(n, 7u);
    EXPECT_EQ(bake(two_rooms(), store).level, first.level);
}
