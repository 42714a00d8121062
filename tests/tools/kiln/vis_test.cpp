// vis as a user runs it: on maps, on portal files of others, on spoiled ones.
#include "formats/portal_file/portal_file.h"
#include "libs/core/file.h"
#include "tests/compiler/visibility/grid_map.h"
#include "tests/support/program.h"
#include <nlohmann/json.hpp>

using namespace kiln;
using namespace kiln::test;
using nlohmann::json;

namespace {

// Three rooms in a row with doors in a zigzag: the first and the last do not see each other.
std::string zigzag() {
    return world(room(400, 128, 64) + box(120, 0, 0, 136, 100, 64) + box(264, 28, 0, 280, 128, 64) + box(150, 28, 0, 250, 100, 64)) + entity("info_player_start", 32, 32, 24);
}
PortalFile file_of(const GridMap& m) {
    PortalFile f;
    f.cluster_count = m.cluster_count;
    for (const VisPortal& p : m.portals) f.portals.push_back({p.cluster_front, p.cluster_back, p.winding, false});
    return f;
}
json run_json(const Workplace& w, std::vector<std::string> words, int code = 0) {
    words.insert(words.begin(), "vis"), words.emplace_back("--json");
    const Outcome o = w.run(words);
    EXPECT_EQ(o.code, code) << o.said;
    return json::parse(o.out, nullptr, false);
}

} // namespace

// The rows of a map, and the rows of the portal file written from it, are the same bytes.
TEST(Vis, APortalFileGivesTheRowsOfItsMap) {
    const Workplace w;
    const std::string map = w.write("zigzag.map", zigzag());
    const json of_map = run_json(w, {map, "-q", "-o", w.path("map.json"), "--prt", w.path("a.prt")});
    const json of_file = run_json(w, {w.path("a.prt"), "-q", "-o", w.path("prt.json")});
    EXPECT_EQ(*read_file(w.path("map.json")), *read_file(w.path("prt.json")));
    EXPECT_EQ(of_map["seen"], of_file["seen"]);
    EXPECT_EQ(of_map["portals"], of_file["portals"]);
    EXPECT_GT(of_map["clusters"], 3);
    EXPECT_LT(of_map["seen"]["pairs"], of_map["clusters"].get<int>() * of_map["clusters"].get<int>()); // something is hidden
    EXPECT_FALSE(of_file["input"]["turned"]);
    // And those of `dump vis`.
    ASSERT_EQ(w.run({"dump", "vis", map, "--json", "-q", "-o", w.path("dump.json")}).code, 0);
    EXPECT_EQ(*read_file(w.path("map.json")), *read_file(w.path("dump.json")));
    ASSERT_EQ(w.run({"dump", "vis", w.path("a.prt"), "--json", "-q", "-o", w.path("of_prt.json")}).code, 0);
    EXPECT_EQ(*read_file(w.path("map.json")), *read_file(w.path("of_prt.json")));
    EXPECT_EQ(w.run({"dump", "faces", w.path("a.prt")}).code, 2);
}

// Clusters of several leaves: means over leaves are weighted by them. Two rooms and one apart, 1, 2 and 3 leaves.
TEST(Vis, MeansOverLeaves) {
    const Workplace w;
    const std::string prt = w.write("m.prt", "PRT2\n6\n3\n1\n4 0 1 (0 0 0 ) (0 0 64 ) (0 64 64 ) (0 64 0 ) \n0 -1\n1 2 -1\n3 4 5 -1\n");
    const json j = run_json(w, {prt, "-q"});
    EXPECT_EQ(j["clusters"], 3);
    EXPECT_EQ(j["leaves"], 6);
    EXPECT_EQ(j["seen"]["pairs"], 5);
    EXPECT_NEAR(j["seen"]["mean_clusters"].get<double>(), 5.0 / 3, 1e-12);
    EXPECT_NEAR(j["seen"]["mean_leaves"].get<double>(), (1 * 3 + 2 * 3 + 3 * 3) / 6.0, 1e-12);
}

// A file whose windings all face the other cluster: read as it stands it would hide what is seen.
TEST(Vis, TurnedFilesAreTurnedBack) {
    const Workplace w;
    std::mt19937 random(3);
    PortalFile file = file_of(grid_map(rooms(random, 2, 2), false, true));
    w.write("right.prt", write_portal_file(file));
    for (FilePortal& p : file.portals) std::ranges::reverse(p.winding);
    w.write("turned.prt", write_portal_file(file));
    const json right = run_json(w, {w.path("right.prt"), "-q"}), turned = run_json(w, {w.path("turned.prt"), "-q"});
    EXPECT_EQ(right["seen"], turned["seen"]);
    EXPECT_TRUE(turned["input"]["turned"]);
    EXPECT_NE(w.run({"vis", w.path("turned.prt")}).said.find("portal-file-turned"), std::string::npos);
    const json fast = run_json(w, {w.path("right.prt"), "--fast-vis", "-q"});
    EXPECT_GT(fast["seen"]["pairs"], right["seen"]["pairs"]);
}

// Spoiled files are refused where they are spoiled, or read; never a crash, never memory on the word of a count.
TEST(Vis, SpoiledPortalFiles) {
    const Workplace w;
    const auto said = [&](const std::string& text, int code) {
        const Outcome o = w.run({"vis", w.write("x.prt", text), "-q"});
        EXPECT_EQ(o.code, code) << text << o.said;
        return o.said;
    };
    EXPECT_NE(said("PRT1\n2\n1\n4 0 1 (0 0 0 ) (0 0 64 )\n(0 sixty 64 ) (0 64 0 )\n", 3).find("x.prt:5:"), std::string::npos);
    EXPECT_NE(said("PRT1\n2\n1\n4 0 2 (0 0 0 ) (0 0 64 ) (0 64 64 ) (0 64 0 )\n", 3).find("x.prt:4:"), std::string::npos);
    EXPECT_NE(said("PRT1\n4000000000\n0\n", 3).find("x.prt:2:"), std::string::npos);
    EXPECT_NE(said("PRT2\n1\n4000000000\n0\n", 3).find("portal-file-"), std::string::npos);
    EXPECT_NE(said("PRT9\n", 3).find("portal-file-magic"), std::string::npos);
    EXPECT_NE(said("PRT1\n2\n1\n4 0 1 (0 0 0 ) (0 0 64 ) (8 64 64 ) (0 64 0 ) \n", 0).find("portal-file-flat"), std::string::npos);
    EXPECT_NE(said("PRT1\n2\n1\n4 0 1 (0 0 0 ) (0 64 64 ) (0 0 48 ) (0 40 0 ) \n", 0).find("portal-file-convex"), std::string::npos); // a bow tie
    said("PRT1\n2\n1\n4 0 1 (0 0 0 ) (0 64 64 ) (0 0 64 ) (0 64 0 ) \n", 0); // both its halves cancel: as one without area, through which all is seen
    EXPECT_NE(said("PRT1\n2\n1\n5 0 1 (0 0 0 ) (0 0 64 ) (0 32 16 ) (0 64 64 ) (0 64 0 ) \n", 0).find("portal 0"), std::string::npos); // a dent
    EXPECT_NE(said("PRT1\n2\n1\n5 0 1 (0 0 32 ) (0 60 32 ) (0 10 0 ) (0 30 60 ) (0 50 0 ) \n", 0).find("portal-file-convex"), std::string::npos); // a star
    EXPECT_EQ(said("PRT1\n2\n1\n5 0 1 (0 0 0 ) (0 0.0001 32 ) (0 0 64 ) (0 64 64 ) (0 64 0 ) \n", 0), ""); // decimals waver
    said("PRT1\n0\n0\n", 0);
    said("PRT1\n3\n2\n3 0 1 (0 0 0 ) (0 0 0 ) (0 0 0 ) \n3 1 2 (0 0 0 ) (0 0 1 ) (0 0 2 ) \n", 0); // no area
    said("PRT1\n2\n1\n3 0 1 (1e300 0 0 ) (0 -1e300 0 ) (0 0 1e300 ) \n", 0);
    said("PRT1\n1\n1\n4 0 0 (0 0 0 ) (0 0 64 ) (0 64 64 ) (0 64 0 ) \n", 0); // back into itself
    const std::string good = write_portal_file(file_of(grid_map({"...", ".#.", "..."})));
    std::mt19937 random(7);
    for (int i = 0; i < 40; ++i) {
        std::string text = good;
        for (int k = 0; k < 3; ++k) text[random() % text.size()] = "0123456789-. ()\nehn"[random() % 19];
        const int code = w.run({"vis", w.write("d.prt", text), "-q"}).code;
        EXPECT_TRUE(code == 0 || code == 3) << code << "\n" << text;
    }
}

// Budgets: of steps, the same every time; of time, taken up again from the cache until it is whole; Ctrl-C leaves that too.
TEST(Vis, BudgetsEndInValidRowsAndGoOn) {
    const Workplace w;
    std::mt19937 random(5);
    const std::string prt = w.write("m.prt", write_portal_file(file_of(grid_map(rooms(random, 3, 3), false, true))));
    const json whole = run_json(w, {prt, "-q"}), fast = run_json(w, {prt, "--fast-vis", "-q"});
    EXPECT_EQ(whole["loose_portals"].size(), 0u);
    const std::vector<std::string> cut = {prt, "-q", "--vis-steps", std::to_string(whole["steps"].get<int>() / 10)};
    const json a = run_json(w, cut), b = run_json(w, cut);
    EXPECT_GT(a["loose_portals"].size(), 0u);
    EXPECT_TRUE(a["loose_portals"][0].contains("at"));
    EXPECT_EQ(a["seen"], b["seen"]);
    EXPECT_EQ(a["loose_portals"], b["loose_portals"]);
    EXPECT_GT(a["seen"]["pairs"], whole["seen"]["pairs"]);
    EXPECT_LE(a["seen"]["pairs"], fast["seen"]["pairs"]);

    const std::string map = w.write("zigzag.map", zigzag()), cache = w.path("cache");
    const Outcome o = w.run({"vis", map, "-q", "--vis-budget", "0.001", "--cache", cache, "--json"});
    ASSERT_EQ(o.code, 0) << o.said;
    const json full = run_json(w, {map, "-q", "--cache", cache}); // not what the budget left
    EXPECT_EQ(full["loose_portals"].size(), 0u);
    EXPECT_EQ(full["seen"], run_json(w, {map, "-q"})["seen"]);
    EXPECT_LE(full["seen"]["pairs"], json::parse(o.out)["seen"]["pairs"]);
    const std::string maze = std::string(KILN_SOURCE_DIR) + "/maps/maze/maze.vmf"; // takes a few steps
    EXPECT_NE(w.run({"vis", maze, "--vis-steps", "1"}).said.find("vis-budget"), std::string::npos);
    EXPECT_EQ(w.run({"vis", maze, "--vis-steps", "100000"}).said.find("vis-budget"), std::string::npos);
}

// A real Ctrl-C in the midst of the flow: nothing is written, and with a cache the next run has what the first had found, even one that is
// given next to no time; left alone, it comes to the rows of a run that was never stopped.
TEST(Vis, GoesOnAfterCtrlC) {
    const Workplace w;
    std::mt19937 random(4);
    std::string blocks;
    for (int i = 0; i < 10; ++i)
        for (int j = 0; j < 10; ++j) {
            const int x = 40 + 110 * i + static_cast<int>(random() % 30), y = 40 + 110 * j + static_cast<int>(random() % 30);
            blocks += box(x, y, 0, x + 50, y + 50, 40 + static_cast<int>(random() % 160));
        }
    const std::string map = w.write("city.map", world(room(1150, 1150, 256) + blocks) + entity("info_player_start", 20, 20, 24));
    const auto pairs = [&](const std::vector<std::string>& words) { return run_json(w, words)["seen"]["pairs"].get<long>(); };
    const std::vector<std::string> no_time = {map, "-q", "--vis-budget", "0.001"};
    const long at_once = pairs(no_time);
    const std::string cache = w.path("cache");
    auto with_cache = no_time;
    with_cache.insert(with_cache.end(), {"--cache", cache});
    bool gone_on = false;
    for (int milliseconds = 200; milliseconds < 60000 && !gone_on; milliseconds = milliseconds * 6 / 5) { // where the flow is depends on the machine
        const Outcome o = w.run({"vis", map, "-q", "--cache", cache, "--json", "-o", w.path("rows.json")}, {.file_bytes = -1, .interrupt_after_ms = milliseconds});
        ASSERT_EQ(o.code, 7) << milliseconds << ": it was through before it was stopped\n" << o.said;
        EXPECT_FALSE(w.has("rows.json"));
        gone_on = pairs(with_cache) < at_once;
    }
    EXPECT_TRUE(gone_on);
    ASSERT_EQ(w.run({"vis", map, "-q", "--cache", cache, "-o", w.path("rows.json")}).code, 0);
    ASSERT_EQ(w.run({"vis", map, "-q", "--threads", "1", "-o", w.path("once.json")}).code, 0);
    EXPECT_EQ(*read_file(w.path("rows.json")), *read_file(w.path("once.json")));
}

// Fewer clusters, each of more leaves, and leaves that see no more than allowed; in rows, portal files, levels.
TEST(Vis, ClustersAreMergedOnDemand) {
    const Workplace w;
    const std::string map = w.write("zigzag.map", zigzag());
    const json alone = run_json(w, {map, "-q"}), free = run_json(w, {map, "-q", "--vis-merge", "0"});
    const json merged = run_json(w, {map, "-q", "--vis-merge", "40", "-o", w.path("rows.json"), "--prt", w.path("merged.prt")});
    const auto mean = [](const json& j) { return j["seen"]["mean_leaves"].get<double>(); };
    EXPECT_EQ(mean(free), mean(alone)); // only what costs nothing
    EXPECT_LE(free["clusters"], alone["clusters"]);
    EXPECT_LT(merged["clusters"], free["clusters"]);
    EXPECT_LT(merged["seen"]["pairs"], alone["seen"]["pairs"]);
    EXPECT_EQ(merged["leaves"], alone["leaves"]);
    EXPECT_LE(mean(merged), mean(alone) * 1.4);
    EXPECT_EQ(static_cast<int>(json::parse(*read_file(w.path("rows.json"))).size()), merged["clusters"].get<int>());
    ASSERT_EQ(w.run({"dump", "vis", map, "--json", "-q", "--vis-merge", "40", "-o", w.path("dump.json")}).code, 0);
    EXPECT_EQ(*read_file(w.path("rows.json")), *read_file(w.path("dump.json")));
    ASSERT_EQ(w.run({"build", map, "--draft", "-q", "--vis-merge", "40", "-o", w.path("m.kiln")}).code, 0);
    ASSERT_EQ(w.run({"dump", "vis", w.path("m.kiln"), "--json", "-q", "-o", w.path("level.json")}).code, 0);
    EXPECT_EQ(*read_file(w.path("rows.json")), *read_file(w.path("level.json")));
    EXPECT_EQ(w.run({"verify", w.path("m.kiln"), "-q"}).code, 0);
    const auto prt = read_portal_file(*read_file(w.path("merged.prt")), "merged.prt");
    ASSERT_TRUE(prt);
    EXPECT_EQ(prt->cluster_count, merged["clusters"].get<std::uint32_t>());
    EXPECT_EQ(prt->leaf_cluster.size(), alone["leaves"].get<std::size_t>());
    EXPECT_NE(w.run({"vis", map, "--vis-merge", "40"}).said.find("vis-merge"), std::string::npos);
    // Of a portal file as of the map.
    ASSERT_EQ(w.run({"vis", map, "-q", "--prt", w.path("alone.prt")}).code, 0);
    EXPECT_LT(run_json(w, {w.path("alone.prt"), "-q", "--vis-merge", "40"})["clusters"], alone["clusters"]);
    EXPECT_EQ(w.run({"vis", map, "-q", "--vis-merge", "-5"}).code, 2);
    EXPECT_EQ(w.run({"trace", "0", "1", map, "-q", "--vis-merge", "40"}).code, 2); // which cluster would that be?
    EXPECT_EQ(w.run({"trace", "20,20,32", "30,30,32", map, "-q", "--vis-merge", "40"}).code, 0);
}

// Two rooms with a door: while it is shut each room keeps to itself; in rows, and in the level.
TEST(Vis, RowsWhileAreaPortalsAreShut) {
    const Workplace w;
    const std::string rooms = world(room(272, 128, 64) + box(128, 0, 0, 144, 48, 64) + box(128, 80, 0, 144, 128, 64) + box(40, 40, 0, 60, 60, 64)) + entity("info_player_start", 20, 20, 24);
    const std::string map = w.write("door.map", rooms + "{\n\"classname\" \"func_areaportal\"\n" + box(132, 48, 0, 140, 80, 64) + "}\n");
    const json j = run_json(w, {map, "-q", "-o", w.path("rows.json")});
    ASSERT_TRUE(j.contains("shut"));
    EXPECT_LT(j["shut"]["mean_clusters"], j["seen"]["mean_clusters"]);
    ASSERT_EQ(w.run({"build", map, "--draft", "-q", "-o", w.path("door.kiln")}).code, 0);
    ASSERT_EQ(w.run({"dump", "vis", w.path("door.kiln"), "--json", "-q", "-o", w.path("level.json")}).code, 0);
    EXPECT_EQ(*read_file(w.path("rows.json")), *read_file(w.path("level.json")));
    EXPECT_EQ(w.run({"verify", w.path("door.kiln"), "-q"}).code, 0);
    std::size_t less = 0;
    const auto bytes = *read_file(w.path("rows.json"));
    for (const json& row : json::parse(std::string(bytes.begin(), bytes.end()))) {
        EXPECT_LE(row["shut"].size(), row["sees"].size());
        less += row["shut"].size() < row["sees"].size();
    }
    EXPECT_GT(less, 2u);
    EXPECT_FALSE(run_json(w, {w.write("plain.map", rooms), "-q"}).contains("shut"));
    // A budget of steps ends both flows, the same every time; a budget of time goes on with both.
    const std::vector<std::string> cut = {map, "-q", "--vis-steps", "1"};
    EXPECT_EQ(run_json(w, cut)["shut"], run_json(w, cut)["shut"]);
    const std::string cache = w.path("cache");
    (void)run_json(w, {map, "-q", "--vis-budget", "0.001", "--cache", cache});
    EXPECT_EQ(run_json(w, {map, "-q", "--cache", cache})["shut"], j["shut"]);
}

TEST(Vis, TheFarzOfFogIsARadius) {
    const Workplace w;
    const auto with = [&](const std::string& farz) { return w.write("fog.map", zigzag() + entity("env_fog_controller", 40, 40, 24, "\"farz\" \"" + farz + "\"\n")); };
    const auto pairs = [&](std::vector<std::string> words) { return words.emplace_back("-q"), run_json(w, words)["seen"]["pairs"].get<int>(); };
    const int all = pairs({with("-1")});
    EXPECT_LT(pairs({with("60")}), all);
    EXPECT_EQ(pairs({with("100000")}), all);
    EXPECT_EQ(pairs({with("60"), "--vis-radius", "0"}), all);
    EXPECT_EQ(pairs({with("-1"), "--vis-radius", "60"}), pairs({with("60")}));
    EXPECT_NE(w.run({"vis", with("60")}).said.find("vis-radius"), std::string::npos);
}

// trace: a line that is one, a chain, and the trail that editors show.
TEST(Vis, TraceSaysWhy) {
    const Workplace w;
    const std::string map = w.write("zigzag.map", zigzag());
    const auto trace = [&](const std::string& a, const std::string& b, std::vector<std::string> more = {}) {
        std::vector<std::string> words = {"trace", a, b, map, "-q", "--json"};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome o = w.run(words);
        EXPECT_EQ(o.code, 0) << o.said;
        return json::parse(o.out, nullptr, false);
    };
    const json near = trace("20,120,32", "145,110,32", {"-o", w.path("near.lin")});
    EXPECT_TRUE(near["sees"]);
    EXPECT_EQ(near["line"].size(), 2u);
    EXPECT_GE(near["portals"].size(), 1u);
    EXPECT_EQ(read_trail(*read_file(w.path("near.lin")), "near.lin")->size(), 2u);
    const json far = trace("20,20,32", "390,120,32");
    EXPECT_FALSE(far["sees"]);
    EXPECT_TRUE(far["portals"].empty());
    EXPECT_NE(w.run({"trace", "20,20,32", "390,120,32", map}).out.find("do not see each other"), std::string::npos);
    EXPECT_TRUE(trace("0", "0")["sees"]);
    EXPECT_EQ(w.run({"trace", "0", "999", map, "-q"}).code, 2);
    EXPECT_EQ(w.run({"trace", "0", "1,2", map, "-q"}).code, 2);
    EXPECT_EQ(w.run({"trace", "0", "125,20,32", map, "-q"}).code, 2); // in a wall
    EXPECT_EQ(w.run({"trace", "0", "0", map, "-q", "-o", w.path("x.txt")}).code, 2);
}

TEST(Vis, APlanOfWhatIsSeen) {
    const Workplace w;
    const std::string map = w.write("zigzag.map", zigzag()), level = w.path("zigzag.kiln");
    ASSERT_EQ(w.run({"build", map, "--draft", "-q", "-o", level}).code, 0);
    EXPECT_EQ(w.run({"image", level, "--vis", "20", "20", "32", "-q", "-o", w.path("a.png")}).code, 0);
    EXPECT_EQ(w.run({"image", level, "--vis", "390", "120", "32", "-q", "-o", w.path("b.png")}).code, 0);
    EXPECT_NE(*read_file(w.path("a.png")), *read_file(w.path("b.png"))); // from the other end other things are seen
    EXPECT_EQ(w.run({"image", level, "--vis", "125", "20", "32", "-q"}).code, 2); // in a wall
}
