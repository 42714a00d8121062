// Laws of the whole way: the cache and the thread count change nothing, edits redo what depends on them and no more.
#include "tests/support/program.h"
#include "compiler/compile.h"
#include "libs/core/process.h"
#include <cmath>
#include <cstring>
#include <functional>
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

// Whatever is edited, on a cache that has seen all the others before: the bytes of a clean build. Some change what rays meet and no patch.
TEST(Bake, AnyEditOnAWarmCacheGivesTheBytesOfACleanBuild) {
    struct Case {
        const char* name;
        std::string text, materials;
        std::function<void(CompileOptions&)> set;
    };
    const auto materials = [](const char* glass = R"("alpha": 0.5, "tint": [1, 0.5, 0.5])", const char* wall = R"("reflectance": [0.5, 0.5, 0.5])") {
        return std::string(R"({"materials": {"glass": {"reflectance": [0.2, 0.2, 0.2], )") + glass + R"(}, "wall": {)" + wall + "}}}";
    };
    const std::string lit = materials();
    const auto brush_entity = [](double x, const char* keys, const char* texture = "wall") {
        return std::string("{\n\"classname\" \"func_wall\"\n") + keys + box(x, 20, 20, x + 4, 60, 60, texture) + "}\n";
    };
    const auto curve_entity = [](const char* keys) { // a sheet of patches on the floor
        const std::string points = "( ( 90 20 0 0 0 ) ( 90 20 20 0 0 ) ( 90 20 40 0 0 ) )\n( ( 90 40 0 0 0 ) ( 90 40 20 0 0 ) ( 90 40 40 0 0 ) )\n( ( 90 60 0 0 0 ) ( 90 60 20 0 0 ) ( 90 60 40 0 0 ) )\n";
        return std::string("{\n\"classname\" \"func_wall\"\n") + keys + "{\npatchDef2\n{\nwall\n( 3 3 0 0 0 )\n(\n" + points + ")\n}\n}\n}\n";
    };
    const auto with = [](const std::string& brushes, const std::string& keys = "", const std::string& light = "\"light\" \"300\"\n") {
        return "{\n\"classname\" \"worldspawn\"\n" + keys + room(128, 96, 80) + box(60, 0, 0, 68, 40, 80) + box(60, 56, 0, 68, 96, 80) + brushes + "}\n" + entity("light", 30, 48, 60, light) +
               entity("info_player_start", 100, 48, 24);
    };
    const auto blocker = [&](double z) { return with(box(8, 8, z, 24, 24, z + 4, "common/blocklight")); };
    const std::string pane = box(63, 40, 0, 65, 56, 80, "glass"), plain = with(""), glazed = with(pane);
    const std::vector<Case> cases{
        {"plain", plain, lit, {}},
        {"blocker", blocker(30), lit, {}},
        {"blocker moved", blocker(50), lit, {}},
        {"glass", glazed, lit, {}},
        {"glass: not there", glazed, materials(R"("alpha": 0)"), {}},
        {"glass: opaque", glazed, materials(R"("alpha": 1, "translucent": true)"), {}},
        {"glass: more of it", glazed, materials(R"("alpha": 0.8, "tint": [1, 0.5, 0.5])"), {}},
        {"glass: another tint", glazed, materials(R"("alpha": 0.5, "tint": [0.5, 1, 0.5])"), {}},
        {"glass: its hue", glazed, materials(R"("alpha": 0.5, "translucent": true)"), {}},
        {"wall", plain, materials("\"alpha\": 0.5", R"("reflectance": [0.5, 0.2, 0.5])"), {}},
        {"wall shines", plain, materials("\"alpha\": 0.5", R"("reflectance": [0.5, 0.5, 0.5], "emission": [1, 1, 1])"), {}},
        {"brush entity", plain + brush_entity(90, "\"_shadow\" \"1\"\n"), lit, {}},
        {"brush entity moved", plain + brush_entity(96, "\"_shadow\" \"1\"\n"), lit, {}},
        {"brush entity without shadow", plain + brush_entity(90, ""), lit, {}},
        {"brush entity faded", plain + brush_entity(90, "\"_shadow\" \"1\"\n\"alpha\" \"0.5\"\n"), lit, {}},
        {"curve", plain + curve_entity("\"_shadow\" \"1\"\n"), lit, {}},
        {"curve without shadow", plain + curve_entity(""), lit, {}},
        {"curve faded", plain + curve_entity("\"_shadow\" \"1\"\n\"alpha\" \"0.5\"\n"), lit, {}},
        {"sun", with(box(20, 20, 76, 40, 40, 80, "sky"), "\"_sunlight\" \"100\"\n\"_sunlight_mangle\" \"0 -70 0\"\n"), lit, {}},
        {"sun turned", with(box(20, 20, 76, 40, 40, 80, "sky"), "\"_sunlight\" \"100\"\n\"_sunlight_mangle\" \"30 -60 0\"\n"), lit, {}},
        {"sky", with(box(20, 20, 76, 40, 40, 80, "sky"), "\"_sunlight2\" \"100\"\n"), lit, {}},
        {"style", with("", "", "\"light\" \"300\"\n\"style\" \"2\"\n"), lit, {}},
        {"luxel", plain, lit, [](CompileOptions& o) { o.world.lightmap_scale = 24; }},
        {"directional", plain, lit, [](CompileOptions& o) { o.light.directional = Directional::all; }},
        {"encoding", plain, lit, [](CompileOptions& o) { o.light.directional = Directional::all, o.light.encoding = RnmEncoding::sq; }},
        {"seed", plain, lit, [](CompileOptions& o) { o.light.seed = 2; }},
        {"error", plain, lit, [](CompileOptions& o) { o.light.error_percent = 15; }},
        {"plain again", plain, lit, {}},
    };
    const Workplace w;
    const ContentStore store(w.path("cache")), none("");
    for (const Case& c : cases) {
        const auto built = [&](const ContentStore& in) {
            CompileInput input;
            input.map = {"test.map", Bytes(c.text.begin(), c.text.end())};
            input.materials = {{"test.materials.json", Bytes(c.materials.begin(), c.materials.end())}};
            CompileOptions options;
            options.light.error_percent = 20, options.ambient.error_percent = 80, options.ambient.rays = 64;
            options.world.lightmap_scale = 32;
            if (c.set) c.set(options);
            Context context;
            context.threads = 1;
            Compiled out;
            CompileRun run;
            run.store = &in;
            const auto done = compile(input, options, run, context, out);
            EXPECT_TRUE(done) << c.name << (done ? "" : to_text(done.fault().diagnostic));
            return out.level;
        };
        EXPECT_EQ(built(store), built(none)) << c.name;
    }
}

// What no mapper means and some maps have: a level whose light is finite, or an error that says where; and soon.
TEST(Bake, HostileLightIsFiniteOrAnError) {
    struct Case {
        const char* name;
        std::string text, materials;
    };
    const auto rooms = [](const std::string& brushes, const std::string& entities, const std::string& keys = "", const char* wall = "wall") {
        std::string shell = room(128, 96, 80);
        for (std::size_t at = 0; (at = shell.find("wall", at)) != std::string::npos; at += std::strlen(wall)) shell.replace(at, 4, wall);
        return "{\n\"classname\" \"worldspawn\"\n" + keys + shell + brushes + "}\n" + entity("info_player_start", 100, 48, 24) + entities;
    };
    const auto light = [](double x, double y, double z, const std::string& value) { return entity("light", x, y, z, "\"light\" \"" + value + "\"\n"); };
    const auto wall = [](const char* keys) { return std::string(R"({"materials": {"wall": {)") + keys + "}}}"; };
    const std::string lit = light(30, 48, 60, "300");
    std::vector<Case> cases{
        {"nothing at all", "", ""},
        {"an empty world", "{\n\"classname\" \"worldspawn\"\n}\n", ""},
        {"one brush, no air", world(box(0, 0, 0, 64, 64, 64)) + lit, ""},
        {"no light", rooms("", ""), ""},
        {"intensity 0", rooms("", light(30, 48, 60, "0")), ""},
        {"intensity 1e30", rooms("", light(30, 48, 60, "1e30")), ""},
        {"intensity 1e300", rooms("", light(30, 48, 60, "1e300")), ""},
        {"intensity 1e-30", rooms("", light(30, 48, 60, "1e-30")), ""},
        {"both", rooms("", light(30, 48, 60, "1e30") + light(90, 48, 60, "1e-30")), ""},
        {"intensity nan", rooms("", light(30, 48, 60, "nan")), ""},
        {"negative intensity", rooms("", lit + light(90, 48, 60, "-500")), ""},
        {"in a wall", rooms("", light(-8, 48, 60, "300")), ""},
        {"on a face", rooms("", light(0, 48, 60, "300")), ""},
        {"in a corner", rooms("", light(0, 0, 0, "300")), ""},
        {"all in one place", rooms("", lit + lit + lit + lit), ""},
        {"far out", rooms("", light(1e6, 1e6, 1e6, "300")), ""},
        {"a spot at itself", rooms("", entity("light", 30, 48, 60, "\"light\" \"300\"\n\"target\" \"t\"\n\"angle\" \"0\"\n") + entity("info_null", 30, 48, 60, "\"targetname\" \"t\"\n")), ""},
        {"a sun without sky", rooms("", lit, "\"_sunlight\" \"300\"\n"), ""},
        {"a sun along the floor", rooms("", "", "\"_sunlight\" \"1e30\"\n\"_sunlight_mangle\" \"0 0 0\"\n", "sky"), ""},
        {"all sky", rooms("", lit, "\"_sunlight2\" \"300\"\n", "sky"), ""},
        {"reflectance 1", rooms("", lit), wall(R"("reflectance": [1, 1, 1])")},
        {"reflectance 1, shining", rooms("", ""), wall(R"("reflectance": [1, 1, 1], "emission": [1, 1, 1])")},
        {"black, shining", rooms("", ""), wall(R"("reflectance": [0, 0, 0], "emission": [1, 1, 1])")},
        {"black, lit", rooms("", lit), wall(R"("reflectance": [0, 0, 0])")},
        {"emission 1e30", rooms("", ""), wall(R"("reflectance": [0.5, 0.5, 0.5], "emission": [1e30, 0, 0])")},
        {"emission 1e-30", rooms("", ""), wall(R"("reflectance": [0.5, 0.5, 0.5], "emission": [1e-30, 0, 0])")},
        {"slivers", rooms(box(20, 20, 20, 20.01, 60, 20.01) + box(40, 20, 0, 60, 20.002, 60), lit), ""},
        {"a speck", world(box(-1, -1, -1, 2, 2, 0) + box(-1, -1, 1, 2, 2, 2) + box(-1, -1, 0, 0, 2, 1) + box(1, -1, 0, 2, 2, 1) + box(0, -1, 0, 1, 0, 1) + box(0, 1, 0, 1, 2, 1)) +
                        entity("info_player_start", 0.5, 0.5, 0.5) + light(0.5, 0.5, 0.5, "300"), ""},
    };
    std::string lamps;
    for (int i = 0; i < 2000; ++i) lamps += light(4 + i % 40 * 3, 4 + i / 40 % 25 * 3.5, 20 + i / 1000 * 20, "3");
    cases.push_back({"2000 lamps", rooms("", lamps), ""});
    for (const Case& c : cases) {
        CompileInput input;
        input.map = {"test.map", Bytes(c.text.begin(), c.text.end())};
        if (!c.materials.empty()) input.materials = {{"test.materials.json", Bytes(c.materials.begin(), c.materials.end())}};
        CompileOptions options;
        options.light.error_percent = 20, options.ambient.error_percent = 80, options.ambient.rays = 64;
        options.world.lightmap_scale = 32;
        Context context;
        context.threads = 2;
        Compiled out;
        const CompileRun run;
        const double before = cpu_seconds();
        const auto done = compile(input, options, run, context, out);
        EXPECT_LT(cpu_seconds() - before, 60) << c.name;
        if (!done) {
            EXPECT_EQ(done.fault().diagnostic.where.file, "test.map") << c.name << ": " << to_text(done.fault().diagnostic);
            continue;
        }
        validate(out.lighting, out.surfaces);
        const ErrorReport& e = out.lighting.error;
        for (const double x : {e.estimate, e.low, e.high, e.noise, e.patch_bias, e.iteration, e.shortcuts, e.solution}) EXPECT_TRUE(std::isfinite(x)) << c.name;
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
