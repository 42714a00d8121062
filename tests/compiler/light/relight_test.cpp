// A bake that takes over what an earlier one of the same geometry came to gives the bytes of one that does not.
#include "compiler/light/memo.h"
#include "tests/compiler/light/scenes.h"
#include <gtest/gtest.h>
#include <map>

namespace kiln::test {
namespace {

const std::vector<Light> kLamps{point_light({60, 60, 120}, {3e3f, 3e3f, 2e3f}), point_light({250, 60, 100}, {1e3f, 2e3f, 1e3f}), point_light({290, 290, 40}, {500, 100, 100})};
const LightOptions kOptions{.error_percent = 20, .directional = Directional::all};

Bytes baked(SurfacesBuilder scene, const std::vector<Light>& lights, LightMemo* memo, LightOptions options = kOptions, int threads = 1) {
    Context context;
    context.threads = threads;
    auto r = bake_light(scene.world, {}, {}, scene.surfaces, lights, options, context, memo);
    return r ? to_bytes(*r) : Bytes{};
}

// Through bytes, as from the cache; with a store of rows.
LightMemo stored(const LightMemo& memo) {
    LightMemo out = from_bytes<LightMemo>(to_bytes(memo));
    out.load_rows = memo.load_rows, out.save_rows = memo.save_rows;
    return out;
}
LightMemo empty_memo() {
    const auto store = std::make_shared<std::map<Hash, Bytes>>();
    LightMemo memo;
    memo.load_rows = [store](Hash table) -> std::optional<Buffer> {
        const auto at = store->find(table);
        return at == store->end() ? std::nullopt : std::optional(Buffer(at->second));
    };
    memo.save_rows = [store](Hash table, Bytes rows) { store->emplace(table, std::move(rows)); };
    return memo;
}

struct Edit {
    const char* name;
    std::vector<Light> lights = kLamps;
    Rgb lamp{20, 20, 20}, wall{0.6f, 0.6f, 0.6f};
    Rgb grate{0.3f, 0.2f, 0.1f}, screen{0.5f, 1, 2}; // of the panes: what one reflects, what the other sends
};
std::vector<Edit> edits() {
    std::vector<Edit> all{{.name = "nothing"}};
    Edit e{.name = "brighter"};
    e.lights[1].intensity = {1e3f, 2e3f, 3e3f};
    all.push_back(e);
    e = {.name = "moved"}, e.lights[2].position.x -= 30;
    all.push_back(e);
    e = {.name = "one more"}, e.lights.insert(e.lights.begin(), point_light({100, 250, 100}, {400, 400, 400}));
    all.push_back(e);
    e = {.name = "one less"}, e.lights.erase(e.lights.begin());
    all.push_back(e);
    e = {.name = "one twice"}, e.lights.insert(e.lights.begin() + 1, e.lights[0]);
    all.push_back(e);
    e = {.name = "none"}, e.lights.clear();
    all.push_back(e);
    e = {.name = "sky"}, e.lights.push_back(point_light({}, {1, 1, 1})), e.lights.back().kind = LightKind::sky;
    all.push_back(e);
    e = {.name = "emission"}, e.lamp = {30, 20, 20};
    all.push_back(e);
    e = {.name = "lamp out"}, e.lamp = {};
    all.push_back(e);
    e = {.name = "reflectance"}, e.wall = {0.3f, 0.6f, 0.6f};
    all.push_back(e);
    e = {.name = "black"}, e.wall = {};
    all.push_back(e);
    return all;
}
// What guides know of something small and bright far off changes with its light.
TEST(Relight, ASpotDownAHall) {
    const LightOptions options{.error_percent = 5, .directional = Directional::all, .error_floor = 1e-6};
    const auto lamps = [](float end, float near) { return std::vector<Light>{lamp_of_the_hall(end), point_light({6000, 256, 200}, {near, near, near})}; };
    LightMemo memo = empty_memo();
    (void)baked(lit_square_down_a_hall(), lamps(1e5f, 0), &memo, options);
    for (const auto& edited : {lamps(1.0001e5f, 0), lamps(1.3e5f, 0), lamps(1.3e5f, 1e-3f), lamps(0, 1e-3f), lamps(1e5f, 0)}) {
        memo = stored(memo);
        EXPECT_EQ(baked(lit_square_down_a_hall(), edited, &memo, options), baked(lit_square_down_a_hall(), edited, nullptr, options));
    }
}

// Of lamps that stand twice, one is taken away and another changed.
TEST(Relight, EqualLampsAtOnePlace) {
    std::vector<Light> lamps = kLamps;
    lamps.insert(lamps.end(), {kLamps[0], kLamps[0], kLamps[2]});
    LightMemo memo = empty_memo();
    (void)baked(two_rooms(20), lamps, &memo);
    lamps.erase(lamps.begin());
    lamps[1].intensity = {700, 100, 100};
    memo = stored(memo);
    EXPECT_EQ(baked(two_rooms(20), lamps, &memo), baked(two_rooms(20), lamps, nullptr));
}

enum class Panes { none, some };
// With panes: tinted glass in the doorway, a grate that reflects and a screen that shines below the lamp, in front of each other.
SurfacesBuilder scene_of(const Edit& e, Panes panes = Panes::none) {
    SurfacesBuilder scene = two_rooms(20);
    if (panes == Panes::some) {
        pane(scene, {185, 120, 0}, {0, 60, 0}, {0, 0, 100}, glass(scene, 0.3f, {0.2f, 0.1f, 0.4f}));
        pane(scene, {20, 20, 120}, {120, 0, 0}, {0, 120, 0}, checkers(scene, 20, e.grate), 4);
        pane(scene, {30, 30, 100}, {100, 0, 0}, {0, 100, 0}, glass(scene, 0.4f, {0.1f, 0.1f, 0.1f}, Rgb{1, 1, 1}, e.screen));
    }
    for (Material& m : scene.world.materials) {
        if (m.emission.x > 0) m.emission = e.lamp;
        else if (m.reflectance.x == 0.6f) m.reflectance = e.wall;
    }
    return scene;
}

TEST(Relight, SameBytesAfterEachEdit) {
    LightMemo first = empty_memo();
    const Bytes plain = baked(scene_of({}), kLamps, nullptr);
    EXPECT_EQ(baked(scene_of({}), kLamps, &first), plain) << "a memo changes nothing";
    const LightMemo kept = stored(first);
    for (const Edit& e : edits()) {
        const Bytes anew = baked(scene_of(e), e.lights, nullptr);
        for (const int threads : {1, 3}) {
            LightMemo memo = kept;
            EXPECT_EQ(baked(scene_of(e), e.lights, &memo, kOptions, threads), anew) << e.name;
        }
    }
}

// A lamp that only gets brighter or another colour casts the shadows that it cast.
TEST(Relight, DirectLightOfABrighterLampIsNotTracedAgain) {
    LightMemo memo = empty_memo();
    (void)baked(two_rooms(20), kLamps, &memo);
    memo = stored(memo);
    std::vector<Light> lamps = kLamps;
    lamps[0].intensity = {lamps[0].intensity.x * 1.03f, lamps[0].intensity.y * 1.01f, lamps[0].intensity.z};
    EXPECT_EQ(baked(two_rooms(20), lamps, &memo), baked(two_rooms(20), lamps, nullptr));
    EXPECT_GT(memo.direct.found(), 0u);
    EXPECT_EQ(memo.direct.size(), memo.direct.found()) << "traced anew";
}

// Patches of faces without luxels are sampled for themselves, light by light.
TEST(Relight, FacesWithoutLuxels) {
    const auto scene = [] {
        SurfacesBuilder s = two_rooms(20);
        s.rect({200, 20, 1}, {100, 0, 0}, {0, 100, 0}, s.material({0.7f, 0.3f, 0.1f}), {.chart = false});
        s.rect({20, 20, 1}, {60, 0, 0}, {0, 60, 0}, s.material({0.2f, 0.3f, 0.6f}), {.chart = false});
        return s;
    };
    LightMemo memo = empty_memo();
    (void)baked(scene(), kLamps, &memo);
    for (const Edit& e : edits()) {
        LightMemo kept = stored(memo);
        EXPECT_EQ(baked(scene(), e.lights, &kept), baked(scene(), e.lights, nullptr)) << e.name;
    }
}

// Which lamps are left to gathered rays is taken over, too. The ceiling of what is above and its walls are two lamps.
TEST(Relight, LampsAboveAHole) {
    const auto scene = [](Rgb walls, Rgb ceiling) {
        int made = 0;
        return room_under_a_hole([&](SurfacesBuilder& s) { return s.material({0.3f, 0.3f, 0.3f}, made++ ? ceiling : walls); }, {.luxel = 64}, 0.5f);
    };
    LightMemo memo = empty_memo();
    (void)baked(scene({2, 2, 2}, {3, 3, 3}), {}, &memo);
    const std::vector<Light> inside{point_light({60, 60, 60}, {20, 20, 20})};
    bool some = false;
    for (const std::vector<Light>& lights : {std::vector<Light>{}, inside})
        for (const Rgb ceiling : {Rgb{3, 3, 3}, Rgb{3.02f, 3, 3}, Rgb{5, 3, 1}, Rgb{}, Rgb{3, 3, 3}}) {
            memo = stored(memo);
            EXPECT_EQ(baked(scene({2, 2, 2}, ceiling), lights, &memo), baked(scene({2, 2, 2}, ceiling), lights, nullptr));
            some |= memo.taken_over() > 0 && memo.taken_over() < 1;
        }
    EXPECT_TRUE(some);
}

// What luxels have gathered is read by others, round by round.
TEST(Relight, AShaftBesideARoom) {
    const auto lamps = [](float much, double x) { return std::vector<Light>{point_light({20, 128, 20}, Rgb{4000, 4000, 4000} * much), point_light({x, 40, 100}, {500, 300, 200})}; };
    const LightOptions options{.error_percent = 5, .directional = Directional::all};
    LightMemo memo = empty_memo();
    baked(shaft_beside_a_room(), lamps(1, 200), &memo, options);
    for (const auto& after : {lamps(1, 200), lamps(1.05f, 200), lamps(1.4f, 200), lamps(1, 190), lamps(0.2f, 130)}) {
        LightMemo kept = stored(memo);
        const Bytes clean = baked(shaft_beside_a_room(), after, nullptr, options);
        EXPECT_EQ(baked(shaft_beside_a_room(), after, &kept, options, 3), clean);
        kept = stored(kept); // once more, with what that kept
        EXPECT_EQ(baked(shaft_beside_a_room(), after, &kept, options), clean);
        EXPECT_EQ(kept.taken_over(), 1);
    }
}

// One edit after the other, there and back.
TEST(Relight, ChainOfEdits) {
    LightMemo memo = empty_memo();
    for (int round = 0; round < 2; ++round)
        for (const Edit& e : edits()) {
            memo = stored(memo);
            EXPECT_EQ(baked(scene_of(e), e.lights, &memo), baked(scene_of(e), e.lights, nullptr)) << e.name;
        }
}

TEST(Relight, SameBytesAfterEachEditBehindPanes) {
    std::vector<Edit> all = edits();
    Edit e{.name = "grate"};
    e.grate = {0.1f, 0.2f, 0.6f};
    all.push_back(e);
    e = {.name = "screen"}, e.screen = {4, 1, 2};
    all.push_back(e);
    e = {.name = "screen out"}, e.screen = {};
    all.push_back(e);
    const auto scene = [](const Edit& edit) { return scene_of(edit, Panes::some); };
    LightMemo first = empty_memo();
    EXPECT_EQ(baked(scene({}), kLamps, &first), baked(scene({}), kLamps, nullptr)) << "a memo changes nothing";
    LightMemo chain = stored(first);
    for (const Edit& edit : all) {
        const Bytes anew = baked(scene(edit), edit.lights, nullptr);
        LightMemo memo = stored(first);
        EXPECT_EQ(baked(scene(edit), edit.lights, &memo, kOptions, 2), anew) << edit.name;
        chain = stored(chain);
        EXPECT_EQ(baked(scene(edit), edit.lights, &chain), anew) << edit.name << ", after those before";
    }
    LightMemo same = stored(first);
    (void)baked(scene({}), kLamps, &same);
    EXPECT_EQ(same.taken_over(), 1);
}

TEST(Relight, NothingChangedIsTakenOverWhole) {
    LightMemo memo = empty_memo();
    (void)baked(scene_of({}), kLamps, &memo);
    EXPECT_EQ(memo.taken_over(), 0);
    memo = stored(memo);
    (void)baked(scene_of({}), kLamps, &memo);
    EXPECT_EQ(memo.taken_over(), 1);
}

// What a lamp in one room changes in others fades from door to door: far away all is taken over.
TEST(Relight, FarRoomsAreTakenOver) {
    SurfacesBuilder scene;
    const MaterialId grey = scene.material({0.5f, 0.5f, 0.5f});
    constexpr int kRooms = 12;
    std::vector<Light> lamps;
    for (int r = 0; r < kRooms; ++r) { // doors alternate, so that no room sees beyond the next
        const double x = 200.0 * r, left = r % 2 ? 160 : 20, right = r % 2 ? 20 : 160;
        std::array<std::vector<Rect>, 6> holes;
        if (r > 0) holes[0] = {Rect{left, 0, left + 20, 40}};
        if (r + 1 < kRooms) holes[1] = {Rect{right, 0, right + 20, 40}};
        scene.room({{x, 0, 0}, {x + 200, 200, 96}}, all(grey), {.luxel = 20}, holes);
        lamps.push_back(point_light({x + 100, 100, 80}, {500, 500, 500}));
    }
    LightMemo memo = empty_memo();
    (void)baked(scene, lamps, &memo);
    lamps[0].intensity = {800, 500, 500};
    memo = stored(memo);
    EXPECT_EQ(baked(scene, lamps, &memo), baked(scene, lamps, nullptr));
    EXPECT_GT(memo.taken_over(), 0.5);
}

// Little that is new is a table of its own, in front of the others; much of it makes one of what was found or kept.
// Keys of places lie in their order, the last of them within range.
TEST(Relight, KeysGoByPlaces) {
    for (const std::uint64_t places : {1ull, 7ull, 100'000ull}) {
        std::uint64_t before = 0;
        for (std::uint64_t p = 0; p < std::min<std::uint64_t>(places, 50); ++p) {
            const std::uint64_t place = places > 50 ? places - 50 + p : p, least = key_at(place, places, 0);
            for (const std::uint64_t hash : {mix(p), ~std::uint64_t{0}}) EXPECT_GE(key_at(place, places, hash), least);
            EXPECT_NE(key_at(place, places, 1), key_at(place, places, 2));
            EXPECT_TRUE(p == 0 || least > before);
            before = std::max(key_at(place, places, mix(p)), key_at(place, places, ~std::uint64_t{0}));
        }
    }
    Box3 box;
    box.add(Vec3{-10, 0, 5}), box.add(Vec3{90, 0, 6}); // flat along one side
    EXPECT_NE(key_in(box, {-10, 0, 5}, 1), key_in(box, {89, 0, 5}, 1));
    EXPECT_EQ(key_in(box, {90, 0, 6}, 1), key_in(box, {1e9, 7, 1e9}, 1)); // beyond it: what lies next
}

TEST(Relight, OfAMemoIsWrittenWhatIsNew) {
    const std::vector<std::uint64_t> before{1, 2, 3}, after{1, 2, 4};
    Memo memo;
    const auto again = [&] { // through files, as a build does
        for (Memo::Table& t : memo.tables()) t = Memo::Table::of(Buffer(to_bytes(t)));
        memo.begin();
    };
    const auto written = [&] { return std::pair(memo.tables()[0].changed, memo.tables()[1].changed); };
    const auto value = [&](std::uint64_t key, const std::vector<std::uint64_t>& states) {
        const auto found = memo.find(key, states);
        return found ? int{(*found)[0]} : -1;
    };
    memo.begin();
    for (std::uint32_t k = 0; k < 100; ++k) memo.keep(1000 * k, before, {k % 2}, Bytes(10, static_cast<std::uint8_t>(k)));
    memo.keep(5, before, {0, 2}, Bytes(10, 200));
    memo.end();
    EXPECT_EQ(written(), std::pair(false, true));
    EXPECT_EQ(memo.size(), 101u);
    const Bytes stored = to_bytes(memo);
    again();
    for (std::uint32_t k = 0; k < 100; ++k) EXPECT_EQ(value(1000 * k, after), static_cast<int>(k)); // state 2 is none of theirs
    EXPECT_EQ(value(5, after), -1);
    memo.keep(5, after, {0, 2}, Bytes(10, 201));
    EXPECT_EQ(value(5, after), 201);
    memo.end();
    EXPECT_EQ(written(), std::pair(true, false));
    EXPECT_EQ(memo.tables()[0].entries.size(), 1u);
    EXPECT_EQ(memo.found(), 100u);
    EXPECT_EQ(memo.size(), 101u);
    // Nothing new: nothing to write. Both states of the one are there.
    again();
    EXPECT_EQ(value(5, after), 201);
    EXPECT_EQ(value(5, before), 200);
    memo.end();
    EXPECT_EQ(written(), std::pair(false, false));
    // A tenth renewed; what was renewed before is found no more.
    again();
    for (std::uint32_t k = 0; k < 50; ++k) EXPECT_EQ(value(1000 * k, after), static_cast<int>(k));
    for (std::uint32_t k = 0; k < 10; ++k) memo.renew(1000 * k, after, Bytes(10, 255));
    memo.end();
    EXPECT_EQ(written(), std::pair(true, false));
    EXPECT_EQ(memo.found(), 40u);
    again();
    for (std::uint32_t k = 0; k < 100; ++k) EXPECT_EQ(value(1000 * k, before), k < 10 ? 255 : static_cast<int>(k));
    EXPECT_EQ(value(5, after), 201);
    // Most of it anew: one table again, without what nobody asked for.
    again();
    for (std::uint32_t k = 0; k < 50; ++k) EXPECT_EQ(value(1000 * k, after), k < 10 ? 255 : static_cast<int>(k));
    for (std::uint32_t k = 5; k < 65; ++k) memo.keep(1000 * k, after, {k % 2}, Bytes(10, 222));
    memo.end();
    EXPECT_EQ(written(), std::pair(true, true));
    EXPECT_TRUE(memo.tables()[0].entries.empty());
    again();
    for (std::uint32_t k = 0; k < 100; ++k) EXPECT_EQ(value(1000 * k, before), k < 5 ? 255 : k < 65 ? 222 : -1);
    EXPECT_EQ(value(5, after), -1);
    // What was read without a copy is written as it was.
    const Bytes file = to_bytes(memo.tables()[1]);
    EXPECT_EQ(to_bytes(Memo::Table::of(Buffer(file))), file);
    for (const std::size_t less : {std::size_t{1}, file.size() - 8}) EXPECT_THROW(Memo::Table::of(Buffer(std::span(file).first(file.size() - less))), ArchiveError);
    // Places that lie about how much there is: as good as empty.
    Bytes damaged = stored;
    damaged[3 * 8 + 4 * 8] = 255, damaged[3 * 8 + 4 * 8 + 5] = 255; // the end of the first entry
    memo = from_bytes<Memo>(damaged);
    again();
    EXPECT_EQ(value(1000, before), -1);
    EXPECT_TRUE(memo.tables()[1].bytes().empty());
}

// Of other options, other geometry, and of nothing that can be.
TEST(Relight, AForeignMemoIsOfNoUse) {
    LightMemo memo = empty_memo();
    LightOptions other = kOptions;
    other.error_percent = 10;
    (void)baked(two_rooms(10), kLamps, &memo, other);
    memo = stored(memo);
    EXPECT_EQ(baked(two_rooms(20), kLamps, &memo), baked(two_rooms(20), kLamps, nullptr));
    LightMemo of_another_room = empty_memo();
    (void)baked(shaft_beside_a_room(), kLamps, &of_another_room);
    of_another_room = stored(of_another_room);
    EXPECT_EQ(baked(two_rooms(20), kLamps, &of_another_room), baked(two_rooms(20), kLamps, nullptr));
    // Rows that are not whole are traced again.
    const Bytes clean = baked(two_rooms(10), kLamps, nullptr, other);
    for (const std::size_t share : {0, 1, 4, 7}) {
        LightMemo cut = stored(memo);
        int asked = 0;
        cut.load_rows = [&](Hash table) {
            std::optional<Buffer> rows = memo.load_rows(table);
            if (rows) ++asked, rows->keep(0, share == 7 ? rows->bytes().size() - 1 : rows->bytes().size() * share / 8);
            return rows;
        };
        cut.save_rows = nullptr;
        EXPECT_EQ(baked(two_rooms(10), kLamps, &cut, other), clean);
        EXPECT_GT(asked, 0);
    }
    Bytes bytes = to_bytes(memo);
    bytes.resize(bytes.size() / 2);
    EXPECT_THROW((void)from_bytes<LightMemo>(bytes), ArchiveError);
}

} // namespace
} // namespace kiln::test
