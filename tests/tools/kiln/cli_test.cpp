// Bad input as users meet it: a located message, the documented exit code, nothing half-written, no crash.
#include "tests/support/program.h"
#include <nlohmann/json.hpp>
#include <map>
#include <regex>

using namespace kiln::test;

namespace {

testing::AssertionResult says(const Outcome& o, const std::string& what) {
    if (o.said.find(what) != std::string::npos) return testing::AssertionSuccess();
    return testing::AssertionFailure() << "\"" << what << "\" is not in:\n" << o.said;
}
Outcome build(const Workplace& w, const std::string& map, std::vector<std::string> more = {}, Limits limits = {}) {
    std::vector<std::string> words = {"build", map, "-o", w.path("out.kiln"), "--draft", "--threads", "2"};
    words.insert(words.end(), more.begin(), more.end());
    return w.run(words, limits);
}
std::string text_of(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

} // namespace

TEST(Cli, ALitRoomBakes) {
    const Workplace w;
    const Outcome o = build(w, w.write("room.map", lit_room()), {"--report", w.path("report.json")});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_TRUE(w.has("out.kiln"));
    EXPECT_TRUE(w.has("report.json"));
    const Outcome info = w.run({"info", w.path("out.kiln"), "--json", "--check"});
    EXPECT_EQ(info.code, 0) << info.said;
    EXPECT_NE(info.out.find("\"clusters\": 1"), std::string::npos) << info.out;
}

TEST(Cli, UnreadableMapsAreInputErrors) {
    const Workplace w;
    std::string garbage(4000, '\0');
    for (std::size_t i = 0; i < garbage.size(); ++i) garbage[i] = static_cast<char>(i * 2654435761u >> 13);
    const std::string whole = lit_room();
    for (const auto& [name, text] : std::vector<std::pair<std::string, std::string>>{
             {"empty.map", ""}, {"empty.vmf", ""}, {"garbage.map", garbage}, {"garbage.vmf", garbage},
             {"truncated.map", whole.substr(0, whole.size() / 2)}, {"truncated.vmf", "world\n{\n\t\"id\" \"1\"\n\tsolid\n\t{\n"}}) {
        const Outcome o = build(w, w.write(name, text));
        EXPECT_EQ(o.code, 3) << name << ": " << o.said;
        EXPECT_TRUE(says(o, name)) << name;
        EXPECT_FALSE(w.has("out.kiln")) << name;
    }
    EXPECT_EQ(build(w, w.path("missing.map")).code, 3);
}

TEST(Cli, EveryTruncationOfAMapEndsInADocumentedWay) {
    const Workplace w;
    const std::string whole = lit_room();
    for (std::size_t n = 1; n < whole.size(); n += 61) {
        const Outcome o = w.run({"build", w.write("cut.map", whole.substr(0, n)), "-o", w.path("out.kiln"), "--stop-after", "csg", "-q"});
        EXPECT_TRUE(o.code == 0 || o.code == 3 || o.code == 4) << n << ": " << o.code << "\n" << o.said;
    }
}

TEST(Cli, AMapThatBeginsWithAVersionIsNoVmf) { // as those of Doom 3 do
    const Workplace w;
    const Outcome o = w.run({"build", w.write("doom.map", "Version 2\n" + lit_room()), "-o", w.path("out.kiln"), "--stop-after", "world", "-q"});
    EXPECT_EQ(o.code, 0) << o.said;
}

TEST(Cli, FaultyBrushesAreNamedAndTheRestIsBuilt) {
    const Workplace w;
    const std::string good = room(128, 96, 80);
    // Three planes only: unbounded. Two coincident opposite planes: no thickness. Points in one line: no plane.
    const std::string unbounded = "{\n( 0 0 0 ) ( 0 1 0 ) ( 0 0 1 ) w 0 0 0 1 1\n( 0 0 0 ) ( 0 0 1 ) ( 1 0 0 ) w 0 0 0 1 1\n( 0 0 0 ) ( 1 0 0 ) ( 0 1 0 ) w 0 0 0 1 1\n}\n";
    std::string collinear = box(40, 40, 0, 60, 60, 20);
    collinear.replace(collinear.find("( "), collinear.find(" wall") - collinear.find("( "), "( 0 0 0 ) ( 1 0 0 ) ( 2 0 0 )");
    for (const auto& [name, brush, code] : std::vector<std::tuple<std::string, std::string, std::string>>{
             {"unbounded.map", unbounded, "brush-unbounded"}, {"flat.map", box(40, 40, 20, 60, 60, 20), "brush-empty"}, {"collinear.map", collinear, "plane-collinear"}}) {
        const std::string text = world(good + brush) + entity("info_player_start", 32, 32, 24) + entity("light", 96, 64, 60);
        const Outcome o = build(w, w.write(name, text));
        EXPECT_EQ(o.code, 0) << name << ": " << o.said;
        EXPECT_TRUE(says(o, code));
        EXPECT_TRUE(says(o, name + ":"));
        EXPECT_TRUE(w.has("out.kiln"));
    }
}

TEST(Cli, CoordinatesThatAreNoNumbersOrOutOfRangeAreNamed) {
    const Workplace w;
    for (const std::string bad : {"nan", "inf", "1e9", "-1e300"}) {
        std::string brush = box(40, 40, 0, 60, 60, 20);
        brush.replace(brush.find("( ") + 2, 8, bad);
        const Outcome o = build(w, w.write("coordinates.map", world(room(128, 96, 80) + brush) + entity("light", 96, 64, 60)));
        EXPECT_TRUE(o.code == 0 || o.code == 3) << bad << ": " << o.code << "\n" << o.said;
        EXPECT_TRUE(says(o, "coordinates.map:")) << bad;
        EXPECT_TRUE(says(o, "error:")) << bad;
    }
}

// Numbers that can each be used and lead out of the world together: the place is told, the rest is built.
TEST(Cli, ADisplacementThatLeavesTheWorldIsNamed) {
    const Workplace w;
    std::string text = text_of(std::string(KILN_SOURCE_DIR) + "/maps/terrain/terrain.vmf");
    const auto change = [&](const char* after, const std::string& from, const std::string& to) {
        const std::size_t at = text.find(from, text.find(after));
        ASSERT_NE(at, std::string::npos);
        text.replace(at, from.size(), to);
    };
    change("normals", "\"row0\" \"0 0 1", "\"row0\" \"0 0 130000");
    const std::size_t row = text.find("\"row0\" \"", text.find("distances")) + 8;
    text.replace(row, text.find(' ', row) - row, "100000");
    const Outcome o = build(w, w.write("far.vmf", text), {"-q"});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_TRUE(std::regex_search(o.said, std::regex("far\\.vmf:\\d+: error: .*vertex 0 in row 0 is moved by 1\\.3e\\+10 map units.*\\[displacement-invalid\\]"))) << o.said;
    EXPECT_EQ(w.run({"verify", w.path("out.kiln"), "-q"}).code, 0);
}

TEST(Cli, ZeroTextureScaleIsAWarning) {
    const Workplace w;
    std::string brushes = room(128, 96, 80);
    for (std::size_t at = 0; (at = brushes.find("0 0 0 1 1\n", at)) != std::string::npos; at += 10) brushes.replace(at, 10, "0 0 0 0 0\n");
    const Outcome o = build(w, w.write("scale.map", world(brushes) + entity("light", 96, 64, 60)));
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_TRUE(says(o, "warning"));
}

TEST(Cli, AWorldWithoutBrushesIsAGeometryError) {
    const Workplace w;
    const Outcome o = build(w, w.write("bare.map", world("") + entity("light", 0, 0, 0)));
    EXPECT_EQ(o.code, 4) << o.said;
    EXPECT_FALSE(w.has("out.kiln"));
}

TEST(Cli, ALeakIsToldWithItsPlaceAndTrail) {
    const Workplace w;
    std::string brushes = room(128, 96, 80);
    brushes = brushes.substr(brushes.find("}\n") + 2); // no floor
    const std::string map = w.write("leak.map", world(brushes) + entity("info_player_start", 32, 32, 24));
    Outcome o = build(w, map);
    EXPECT_EQ(o.code, 4) << o.said;
    EXPECT_TRUE(says(o, "[leak]"));
    EXPECT_FALSE(w.has("out.kiln"));
    EXPECT_TRUE(w.has("out.pts"));
    EXPECT_TRUE(w.has("out.lin"));
    EXPECT_EQ(build(w, map, {"--leak-test"}).code, 4);
    EXPECT_EQ(build(w, map, {"-leaktest", "--report", w.path("leak.json")}).code, 4);
    const auto leaks = nlohmann::json::parse(text_of(w.path("leak.json")))["leaks"];
    ASSERT_EQ(leaks.size(), 1u);
    EXPECT_EQ(leaks[0]["classname"], "info_player_start");
    EXPECT_EQ(leaks[0]["in_void"], false);
    EXPECT_EQ(leaks[0]["area"], 128 * 96);
    EXPECT_EQ(leaks[0]["width"], 96);
    EXPECT_GT(leaks[0]["near"].size(), 3u);
    EXPECT_GT(leaks[0]["near"][0]["line"], 1);
    EXPECT_EQ(leaks[0]["path"][0], (nlohmann::json{32, 32, 24}));
    o = build(w, map, {"--allow-leaks"});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_TRUE(w.has("out.kiln"));
    EXPECT_TRUE(w.has("out.lin"));
    // Once sealed, the trail of yesterday is gone: editors reload an empty one.
    o = build(w, w.write("leak.map", lit_room()));
    EXPECT_EQ(o.code, 0) << o.said;
    ASSERT_TRUE(w.has("out.pts"));
    EXPECT_EQ(text_of(w.path("out.pts")), "");
    EXPECT_FALSE(w.has("out.lin"));
}

// Every leak has its trail, and so has an area portal that parts nothing; mended, they go.
TEST(Cli, FurtherLeaksAndAreaPortalsHaveTrailsOfTheirOwn) {
    const Workplace w;
    const auto room_at = [](double x, bool floor) {
        return (floor ? box(x - 16, -16, -16, x + 144, 112, 0) : "") + box(x - 16, -16, 80, x + 144, 112, 96) + box(x - 16, -16, 0, x, 112, 80) +
               box(x + 128, -16, 0, x + 144, 112, 80) + box(x, -16, 0, x + 128, 0, 80) + box(x, 96, 0, x + 128, 112, 80);
    };
    const std::string things = entity("info_player_start", 32, 32, 24) + entity("light", 532, 32, 40) +
                               "{\n\"classname\" \"func_areaportal\"\n" + box(60, 20, 20, 64, 60, 60) + "}\n" + // in mid air: a way leads around it
                               "{\n\"classname\" \"func_areaportal\"\n" + box(560, 20, 20, 564, 60, 60) + "}\n";
    Outcome o = build(w, w.write("leak.map", world(room_at(0, false) + room_at(500, false)) + things));
    EXPECT_EQ(o.code, 4) << o.said;
    for (const char* name : {"out.pts", "out.lin", "out.leak2.pts", "out.leak2.lin"}) EXPECT_TRUE(w.has(name)) << name;
    EXPECT_NE(text_of(w.path("out.leak2.pts")), text_of(w.path("out.pts")));
    EXPECT_FALSE(w.has("out.prt"));
    const auto dumped = nlohmann::json::parse(w.run({"dump", "leak", w.path("leak.map"), "--json", "-q"}).out);
    ASSERT_EQ(dumped.size(), 2u); // the area portal is told of where the world is sealed
    EXPECT_EQ(dumped[1]["leak"], 2);
    EXPECT_EQ(dumped[1]["area"], 128 * 96);
    EXPECT_GT(dumped[1]["near"].size(), 3u);
    EXPECT_EQ(dumped[1]["near_at"].size(), dumped[1]["near"].size());
    EXPECT_TRUE(std::regex_match(dumped[1]["near_at"][0].get<std::string>(), std::regex("leak\\.map:\\d+"))) << dumped[1];
    EXPECT_EQ(dumped[1]["file"], nullptr); // the map itself
    EXPECT_EQ(dumped[1]["in_void"], false);
    EXPECT_LE(dumped[0]["length"].get<double>(), dumped[1]["length"].get<double>());
    w.write("out.leak2.txt", "of somebody else");
    w.write("outer.leak2.pts", "of another map");
    w.write("out.leak7.map", world("")), w.write("out.leak7.pts", "of the map of that name");
    std::filesystem::create_directory(w.path("out.leak9.pts"));
    o = build(w, w.write("leak.map", world(room_at(0, true) + room_at(500, true)) + things));
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_TRUE(says(o, "[areaportal-leak]")) << o.said;
    const auto around = nlohmann::json::parse(w.run({"dump", "leak", w.path("leak.map"), "--json", "-q"}).out);
    ASSERT_EQ(around.size(), 2u); // sealed; the area portals that part nothing are left
    EXPECT_EQ(around[0]["area_portal"], 0);
    EXPECT_EQ(around[0]["areas"][0], around[0]["areas"][1]);
    EXPECT_EQ(around[0]["path"].front(), around[0]["from"]);
    EXPECT_EQ(around[0]["path"].back(), around[0]["to"]);
    EXPECT_GT(around[0]["length"].get<double>(), 4); // the portal is 4 thick
    EXPECT_FALSE(w.has("out.leak2.pts"));
    EXPECT_FALSE(w.has("out.leak2.lin"));
    EXPECT_TRUE(w.has("out.leak2.txt"));
    for (const char* name : {"outer.leak2.pts", "out.leak7.pts", "out.leak9.pts"}) EXPECT_TRUE(w.has(name)) << name;
    EXPECT_EQ(text_of(w.path("out.pts")), "");
    ASSERT_TRUE(w.has("out.areaportal1.lin"));
    ASSERT_TRUE(w.has("out.areaportal2.lin")); // brush 0 of its entity, as the other is
    EXPECT_NE(text_of(w.path("out.areaportal1.lin")), text_of(w.path("out.areaportal2.lin")));
    std::istringstream corners(text_of(w.path("out.areaportal1.lin")));
    std::size_t lines = 0;
    for (std::string line; std::getline(corners, line);) ++lines;
    EXPECT_GT(lines, 2u);
}

// In a .map brushes are numbered within their entity: all area portals have brush 0.
TEST(Cli, EachAreaPortalHasItsTrailAndItsWarningNamesIt) {
    const Workplace w;
    const auto portal = [](double x) { return "{\n\"classname\" \"func_areaportal\"\n" + box(x, 20, 20, x + 4, 60, 60) + "}\n"; };
    w.write("out.areaportal0.pts", "0 0 0\n"), w.write("out.areaportal17.lin", "0 0 0\n"); // of an earlier build
    const Outcome o = build(w, w.write("m.map", lit_room() + portal(30) + portal(90)), {"--leak-test"});
    EXPECT_EQ(o.code, 0) << o.said;
    std::vector<std::string> names;
    for (const std::string& name : w.files())
        if (name.starts_with("out.areaportal")) names.push_back(name);
    EXPECT_EQ(names, (std::vector<std::string>{"out.areaportal1.lin", "out.areaportal1.pts", "out.areaportal2.lin", "out.areaportal2.pts"}));
    const std::regex warning(":(\\d+): warning: .*\\(trail (areaportal\\d)\\)");
    std::map<std::string, int> lines;
    for (std::sregex_iterator it(o.said.begin(), o.said.end(), warning), end; it != end; ++it) lines[(*it)[2]] = std::stoi((*it)[1]);
    ASSERT_EQ(lines.size(), 2u) << o.said;
    EXPECT_LT(lines["areaportal1"], lines["areaportal2"]);
    for (const auto& [name, x] : std::map<std::string, double>{{"areaportal1", 30}, {"areaportal2", 90}}) { // it begins on its own portal
        std::istringstream trail(text_of(w.path("out." + name + ".pts")));
        double first = 0;
        ASSERT_TRUE(trail >> first) << name;
        EXPECT_GE(first, x) << name;
        EXPECT_LE(first, x + 4) << name;
    }
}

TEST(Cli, ATrailThatCannotBeWrittenIsToldAndTheLeakStillDecides) {
    const Workplace w;
    std::string brushes = room(128, 96, 80);
    brushes = brushes.substr(brushes.find("}\n") + 2); // no floor
    std::filesystem::create_directory(w.path("out.pts"));
    const Outcome o = build(w, w.write("leak.map", world(brushes) + entity("info_player_start", 32, 32, 24)), {"--leak-test"});
    EXPECT_EQ(o.code, 4) << o.said;
    EXPECT_TRUE(says(o, "[leak]"));
    EXPECT_TRUE(says(o, "out.pts: error")) << o.said;
}

// Portals of a sealed world are no portals of one that leaks.
TEST(Cli, APortalFileOfYesterdayGoes) {
    const Workplace w;
    const std::string two = room(256, 96, 80) + box(124, 0, 0, 132, 40, 80) + box(124, 56, 0, 132, 96, 80); // a doorway
    const std::string start = entity("info_player_start", 32, 32, 24) + entity("light", 96, 64, 60);
    const std::string sealed = world(two) + start, leaks = world(two.substr(two.find("}\n") + 2)) + start, single = lit_room();
    w.write("out2.prt", "of another map"), w.write("out.prt.bak", "of somebody else");
    const std::string map = w.write("m.map", sealed);
    ASSERT_EQ(build(w, map).code, 0);
    ASSERT_TRUE(w.has("out.prt"));
    const std::string portals = text_of(w.path("out.prt"));
    EXPECT_EQ(build(w, map, {"--leak-test"}).code, 0); // does not take away what still holds
    EXPECT_EQ(text_of(w.path("out.prt")), portals);
    w.write("m.map", sealed.substr(0, sealed.size() / 2));
    EXPECT_EQ(build(w, map).code, 3); // nothing is known of what holds
    EXPECT_EQ(text_of(w.path("out.prt")), portals);
    w.write("m.map", leaks);
    EXPECT_EQ(build(w, map, {"--leak-test"}).code, 4);
    EXPECT_FALSE(w.has("out.prt"));
    EXPECT_EQ(build(w, map, {"--allow-leaks"}).code, 0); // a level of its own, with portals of its own
    EXPECT_TRUE(w.has("out.prt"));
    EXPECT_EQ(build(w, map).code, 4);
    EXPECT_FALSE(w.has("out.prt"));
    w.write("out.prt", portals), w.write("m.map", single); // one cluster: no portals
    EXPECT_EQ(build(w, map).code, 0);
    EXPECT_FALSE(w.has("out.prt"));
    std::filesystem::create_directory(w.path("out.prt")); // no file: left alone
    w.write("m.map", leaks);
    EXPECT_EQ(build(w, map).code, 4);
    EXPECT_TRUE(w.has("out.prt"));
    EXPECT_EQ(text_of(w.path("out2.prt")), "of another map");
    EXPECT_EQ(text_of(w.path("out.prt.bak")), "of somebody else");
}

TEST(Cli, MissingOrBrokenMaterialFiles) {
    const Workplace w;
    const std::string map = w.write("room.map", lit_room());
    EXPECT_EQ(build(w, map, {"--materials", w.path("none.json")}).code, 3);
    const Outcome o = build(w, map, {"--materials", w.write("broken.json", "{ \"materials\": { \"x\": ")});
    EXPECT_EQ(o.code, 3) << o.said;
    EXPECT_TRUE(says(o, "broken.json"));
    EXPECT_FALSE(w.has("out.kiln"));
}

TEST(Cli, OutputThatCannotBeWritten) {
    const Workplace w;
    const std::string map = w.write("room.map", lit_room());
    EXPECT_EQ(w.run({"build", map, "-o", w.path("no/such/folder.kiln"), "--draft"}).code, 8);
    EXPECT_EQ(w.run({"build", map, "-o", w.path("room.map/x.kiln"), "--draft"}).code, 8);
    // As on a full disk: files cannot grow. What stood there before stays as it was.
    w.write("out.kiln", "yesterday's");
    const Outcome o = build(w, map, {}, {.file_bytes = 2500, .interrupt_after_ms = -1});
    EXPECT_EQ(o.code, 8) << o.said;
    EXPECT_EQ(w.files(), (std::vector<std::string>{"out.kiln", "out.pts", "room.map"}));
    std::ifstream kept(w.path("out.kiln"));
    std::string text;
    std::getline(kept, text);
    EXPECT_EQ(text, "yesterday's");
}

TEST(Cli, CtrlCLeavesNothingBehind) {
    const Workplace w;
    const std::string map = w.write("big.map", world(room(2048, 2048, 512)) + entity("light", 96, 64, 60, "\"light\" \"2000\"\n"));
    const Outcome o = w.run({"build", map, "-o", w.path("out.kiln"), "--error", "0.3", "--luxel", "2"}, {.file_bytes = -1, .interrupt_after_ms = 700});
    EXPECT_EQ(o.code, 7) << o.said;
    EXPECT_TRUE(says(o, "[cancelled]"));
    EXPECT_EQ(w.files(), std::vector<std::string>{"big.map"});
}

TEST(Cli, UsageErrorsNameTheNearestWord) {
    const Workplace w;
    const std::string map = w.write("room.map", lit_room());
    Outcome o = build(w, map, {"--threds", "2"});
    EXPECT_EQ(o.code, 2);
    EXPECT_TRUE(says(o, "--threads"));
    o = w.run({"biuld", map});
    EXPECT_EQ(o.code, 2);
    EXPECT_TRUE(says(o, "build"));
    EXPECT_EQ(w.run({}).code, 2);
    EXPECT_EQ(w.run({"--help"}).code, 0);
    for (const char* command : {"build", "info", "dump", "vis", "trace", "verify", "export", "image", "sample", "gather", "reference", "explain"}) {
        const std::string help = w.run({command, "--help"}).out;
        const std::size_t examples = help.find("example");
        ASSERT_NE(examples, std::string::npos) << command;
        EXPECT_LT(examples, help.find("Usage:")) << command;
        EXPECT_EQ(help.find("kiln info atrium.kiln  "), std::string::npos) << command; // kiln's own examples are not repeated
    }
    EXPECT_EQ(w.run({"explain", "leak"}).code, 0);
    EXPECT_EQ(w.run({"explain", "no-such-code"}).code, 2);
}

TEST(Cli, WordsOfOtherCompilersWork) {
    const Workplace w;
    const Outcome o = w.run({"build", w.write("room.map", lit_room()), "-o", w.path("out.kiln"), "-fast", "-threads", "1", "-bounce", "8"});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_TRUE(says(o, "all bounces"));
}

// A letter with a value does not swallow the rest of a word: `-onlyents` is no file "nlyents".
TEST(Cli, WordsBeginningWithAnOptionsLetterAreNoValues) {
    const Workplace w;
    const std::string map = w.write("room.map", lit_room());
    const std::filesystem::path before = std::filesystem::current_path();
    std::filesystem::current_path(w.path("")); // files named after words would come to lie here
    for (const char* word : {"-onlyents", "-omitdetail", "-oxyz", "-oout.kiln", "-qx", "-hx"}) {
        const Outcome o = w.run({"build", map, "--stop-after", "read", word});
        EXPECT_EQ(o.code, 2) << word << ": " << o.said;
        EXPECT_TRUE(says(o, std::string(word) + (std::string(word) == "-onlyents" || std::string(word) == "-omitdetail" ? ":" : ""))) << word;
        EXPECT_TRUE(says(o, "kiln explain words")) << word;
    }
    EXPECT_EQ(w.files(), std::vector<std::string>{"room.map"});
    std::filesystem::current_path(before);
    EXPECT_EQ(w.run({"dump", "brushes", map, "-q", "-o=" + w.path("a.txt")}).code, 0);
    EXPECT_EQ(w.run({"dump", "brushes", map, "-q", "-o", w.path("b.txt")}).code, 0);
    EXPECT_NE(text_of(w.path("a.txt")), "");
    EXPECT_EQ(text_of(w.path("a.txt")), text_of(w.path("b.txt")));
}

TEST(Cli, EveryKnownWordIsTakenOrSaysWhatTakesItsPlace) {
    const Workplace w;
    const std::string map = w.write("room.map", lit_room());
    std::istringstream list(w.run({"explain", "words"}).out);
    std::size_t taken = 0, refused = 0;
    for (std::string line; std::getline(list, line);) {
        const std::string word = line.substr(0, line.find(' '));
        if (line.find(" is --") != std::string::npos) continue; // below
        const Outcome o = w.run({"build", map, "--stop-after", "read", word});
        const bool no = line.find("(refused)") != std::string::npos;
        EXPECT_EQ(o.code, no ? 2 : 0) << word << ": " << o.said;
        const std::size_t text = line.find(") ") + 2;
        if (text < line.size()) EXPECT_TRUE(says(o, line.substr(text))) << word;
        else EXPECT_FALSE(no) << word;
        ++(no ? refused : taken);
    }
    EXPECT_GT(taken, 60u);
    EXPECT_GT(refused, 20u);
    for (const auto& words : std::vector<std::vector<std::string>>{{"-wadpath", w.path("")}, {"-micro", "0.5"}, {"-textureshadows"}, {"-StaticPropLighting"}, {"-notjunc"}, {"-soft"},
                                                                   {"-soft", "2"}, {"-dirt"}, {"-chop", "16"}, {"-subdivide", "240"}, {"-SMOOTH", "30"}, {"-world_units_per_luxel", "8"},
                                                                   {"-vproject", w.path("")}, {"-bumpall"}, {"-noverbose"}, {"-noleaktest"}, {"-fast", "-threads", "1"}}) {
        std::vector<std::string> all{"build", "--stop-after", "read"};
        all.insert(all.end(), words.begin(), words.end());
        all.push_back(map); // a word that takes too much along would take the map
        const Outcome o = w.run(all);
        EXPECT_EQ(o.code, 0) << words[0] << ": " << o.said;
    }
    EXPECT_TRUE(says(w.run({"build", map, "--stop-after", "read", "-SMOOTH", "999"}), "--smooth")); // it arrives
}

TEST(Cli, JsonLogHasOneObjectALine) {
    const Workplace w;
    const Outcome o = build(w, w.write("room.map", lit_room()), {"--log-format", "json"});
    ASSERT_EQ(o.code, 0) << o.said;
    std::istringstream lines(o.said);
    int count = 0;
    for (std::string line; std::getline(lines, line); ++count) {
        EXPECT_EQ(line.front(), '{') << line;
        EXPECT_EQ(line.back(), '}') << line;
    }
    EXPECT_GE(count, 10);
    EXPECT_TRUE(says(o, "\"event\":\"stage\",\"name\":\"light\""));
}

TEST(Cli, DamagedLevelsAreRefused) {
    const Workplace w;
    ASSERT_EQ(build(w, w.write("room.map", lit_room())).code, 0);
    std::ifstream file(w.path("out.kiln"), std::ios::binary);
    const std::string level((std::istreambuf_iterator<char>(file)), {});
    for (std::size_t n = 0; n < level.size(); n += level.size() / 9 + 1)
        EXPECT_EQ(w.run({"info", "--check", w.write("cut.kiln", level.substr(0, n))}).code, 3) << n;
    EXPECT_EQ(w.run({"info", w.write("text.kiln", "no level")}).code, 3);
}

// Every code that the sources report is explained.
TEST(Cli, EveryDiagnosticCodeIsExplained) {
    const Workplace w;
    const std::string known = w.run({"explain"}).out;
    const std::regex code("(?:report\\(\\s*Severity::\\w+,\\s*|fault\\(\\s*Exit::\\w+,\\s*|tell\\([^\"]*Severity::\\w+,\\s*)\"([a-z0-9-]+)\"");
    std::size_t found = 0;
    for (const char* layer : {"libs", "formats", "compiler", "tools"})
        for (const auto& e : std::filesystem::recursive_directory_iterator(std::filesystem::path(KILN_SOURCE_DIR) / layer)) {
            if (e.path().extension() != ".cpp" && e.path().extension() != ".h") continue;
            std::ifstream file(e.path());
            const std::string text((std::istreambuf_iterator<char>(file)), {});
            for (std::sregex_iterator i(text.begin(), text.end(), code), end; i != end; ++i, ++found)
                EXPECT_NE(("\n" + known).find("\n" + (*i)[1].str() + ": "), std::string::npos) << (*i)[1] << " in " << e.path();
        }
    EXPECT_GT(found, 50u);
}
