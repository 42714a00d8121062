#include "compiler/csg/csg.h"
#include "tests/compiler/assemble/files.h"

namespace kiln::test {
namespace {

// A wedge of three boxes that no rotation maps to itself.
std::string shape(int id = 100) {
    return vmf_box({0, 0, 0}, {64, 32, 16}, id) + vmf_box({64, 0, 0}, {96, 24, 8.5}, id + 10) + vmf_box({0, 0, 16}, {8, 4, 30.25}, id + 20);
}
std::string instance(const std::string& name, Keys keys) {
    keys.insert(keys.begin(), {"file", name});
    return vmf_entity("func_instance", keys);
}

double solid_volume(const Document& document, std::size_t* faces = nullptr) {
    Context context;
    MaterialDatabase materials;
    Result<World> world = build_world(document, materials, {}, context);
    if (!world) throw std::runtime_error(to_text(world.fault().diagnostic));
    Result<Csg> csg = build_csg(*world, {}, context);
    if (!csg) throw std::runtime_error(to_text(csg.fault().diagnostic));
    EXPECT_EQ(csg->report.rounded_sides, 0u);
    double volume = 0;
    for (const Fragment& f : csg->fragments) {
        const std::vector<Vec3> p = points(csg->planes, f.polygon);
        for (std::size_t i = 1; i + 1 < p.size(); ++i) volume += dot(cross(p[i] - p[0], p[i + 1] - p[0]), p[0]) / 6;
    }
    if (faces) *faces = csg->fragments.size();
    return volume;
}

TEST(Instances, AllRotationsOfOneInstanceAreTheRotatedOriginal) {
    const Document original = assembled(vmf_world(shape()), {});
    std::size_t original_faces = 0;
    const double volume = solid_volume(original, &original_faces);
    EXPECT_NEAR(volume, 64 * 32 * 16 + 32 * 24 * 8.5 + 8 * 4 * 14.25, 1e-6);
    for (int p = 0; p < 360; p += 90)
        for (int y = 0; y < 360; y += 90)
            for (int r = 0; r < 360; r += 90) {
                const Document d = assembled(vmf_world("") + instance("part.vmf", {{"origin", "100.5 -20 7"}, {"angles", fmt::format("{} {} {}", p, y, r)}}),
                                             {{"part.vmf", vmf_world(shape())}});
                ASSERT_EQ(d.entities.size(), 1u);
                ASSERT_EQ(d.entities[0].brushes.size(), original.entities[0].brushes.size());
                std::size_t faces = 0;
                EXPECT_NEAR(solid_volume(d, &faces), volume, 1e-6);
                EXPECT_EQ(faces, original_faces);
                const assemble_detail::Matrix m = assemble_detail::matrix_of_angles({double(p), double(y), double(r)});
                using assemble_detail::operator*;
                for (std::size_t b = 0; b < d.entities[0].brushes.size(); ++b)
                    for (std::size_t s = 0; s < 6; ++s) {
                        const DocSide &a = original.entities[0].brushes[b].sides[s], &c = d.entities[0].brushes[b].sides[s];
                        for (std::size_t i = 0; i < 3; ++i) {
                            const Vec3 before = vec(a.points[i]), after = vec(c.points[i]);
                            EXPECT_EQ(after, m * before + (Vec3{100.5, -20, 7})); // exactly
                            // The texture moves along.
                            EXPECT_NEAR(texel(c.texture, after).x, texel(a.texture, before).x, 1e-9);
                            EXPECT_NEAR(texel(c.texture, after).y, texel(a.texture, before).y, 1e-9);
                        }
                    }
            }
}

TEST(Instances, AnglesOffTheAxesKeepVolumeAndTexture) {
    const Document d = assembled(vmf_world("") + instance("part.vmf", {{"origin", "1 2 3"}, {"angles", "10 20 30"}}), {{"part.vmf", vmf_world(vmf_box({0, 0, 0}, {64, 32, 16}, 1))}});
    Context context;
    MaterialDatabase materials;
    const Result<World> world = build_world(d, materials, {}, context);
    ASSERT_TRUE(world);
    const Result<Csg> csg = build_csg(*world, {}, context);
    ASSERT_TRUE(csg);
    EXPECT_EQ(csg->report.invalid_brushes, 0u);
    EXPECT_EQ(csg->brushes[0].faces.size(), 6u);
    EXPECT_LT(csg->report.largest_rounding, 1.0 / 1024);
}

TEST(Instances, NestedOnesCompose) {
    // Inner: moved by x and yawed; outer: yawed again. By hand: R(90) * (R(90) * p + (10,0,0)) + (0,0,100).
    const Files files{{"outer.vmf", vmf_world("") + instance("inner.vmf", {{"origin", "10 0 0"}, {"angles", "0 90 0"}, {"targetname", "in"}})},
                      {"inner.vmf", vmf_world(vmf_box({0, 0, 0}, {4, 2, 1}, 1)) + vmf_entity("info_target", {{"targetname", "spot"}, {"origin", "4 2 1"}, {"angles", "0 10 0"}})}};
    const Document d = assembled(vmf_world("") + instance("outer.vmf", {{"origin", "0 0 100"}, {"angles", "0 90 0"}, {"targetname", "out"}}), files);
    const DocEntity& spot = entity(d, "info_target");
    EXPECT_EQ(spot.get("targetname"), "out-in-spot");
    EXPECT_EQ(spot.get("origin"), "-4 8 101");
    EXPECT_EQ(spot.get("angles"), "0 -170 0");
    ASSERT_EQ(d.included.size(), 2u);
    EXPECT_EQ(d.name_of(spot.file), "inner.vmf");
    EXPECT_EQ(d.name_of(d.entities[0].brushes.at(0).file), "inner.vmf");
    Box3 box;
    for (const DocSide& s : d.entities[0].brushes[0].sides)
        for (const auto& p : s.points) box.add(vec(p));
    EXPECT_EQ(box.lo, (Vec3{-4, 8, 100}));
    EXPECT_EQ(box.hi, (Vec3{0, 10, 101}));
}

TEST(Instances, BrushEntitiesComeAlongAndTheirModelIsNotTurnedTwice) {
    const Files files{{"part.vmf", vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1)) +
                                       vmf_entity("func_door", {{"targetname", "door"}, {"angles", "0 0 0"}, {"movedir", "0 90 0"}, {"origin", "4 0 0"}}, {}, vmf_box({8, 0, 0}, {9, 1, 1}, 20))}};
    const Document d = assembled(vmf_world("") + instance("part.vmf", {{"angles", "0 90 0"}, {"targetname", "a"}}), files);
    const DocEntity& door = entity(d, "func_door");
    EXPECT_EQ(door.brushes.size(), 1u);
    EXPECT_EQ(door.get("angles"), "0 0 0");
    EXPECT_EQ(door.get("movedir"), "0 180 0");
    EXPECT_EQ(door.get("origin"), "0 4 0");
    EXPECT_EQ(d.entities[0].brushes.size(), 1u);
}

TEST(Instances, AMissingFileIsAWarningAtItsLineAndTheBuildGoesOn) {
    Context context;
    const Document d = assembled(vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1)) + instance("gone", {}), {}, context);
    EXPECT_EQ(d.entities.size(), 1u);
    const Diagnostic& told = first(context, "instance-missing");
    EXPECT_EQ(told.severity, Severity::warning);
    EXPECT_EQ(told.where.file, "main.vmf");
    EXPECT_GT(told.where.line, 60);
    EXPECT_NE(told.message.find("tried gone"), std::string::npos);
}

TEST(Instances, AFileThatCannotBeReadIsLeftOut) {
    Context context;
    assembled(vmf_world("") + instance("bad.vmf", {}) + instance("bad.vmf", {}), {{"bad.vmf", "world\n{\n"}}, context);
    EXPECT_EQ(count(context, "unbalanced-braces"), 1u); // read once
    EXPECT_EQ(first(context, "unbalanced-braces").where.file, "bad.vmf");
    EXPECT_EQ(first(context, "unbalanced-braces").severity, Severity::warning); // the map around it is built
    EXPECT_EQ(count(context, "instance-unreadable"), 2u);
}

TEST(Instances, CirclesEnd) {
    Context context;
    const Files files{{"a.vmf", vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1)) + instance("b.vmf", {})}, {"b.vmf", vmf_world("") + instance("a.vmf", {}) + instance("main.vmf", {})}, {"main.vmf", ""}};
    const std::string main = vmf_world("") + instance("a.vmf", {});
    Files all = files;
    all["main.vmf"] = main;
    const Document d = assembled(main, all, context);
    EXPECT_EQ(d.entities[0].brushes.size(), 1u);
    EXPECT_EQ(count(context, "instance-cycle"), 2u);
    EXPECT_EQ(first(context, "instance-cycle").where.file, "b.vmf");
    EXPECT_NE(first(context, "instance-cycle").message.find("a.vmf -> b.vmf -> a.vmf"), std::string::npos);
}

TEST(Instances, FilesThatMultiplyWithoutEndMeetALimit) {
    Files files;
    for (int i = 0; i < 70; ++i) files[fmt::format("{}.vmf", i)] = vmf_world("") + instance(fmt::format("{}.vmf", i + 1), {});
    files["70.vmf"] = vmf_world("");
    Context context;
    assembled(vmf_world("") + instance("0.vmf", {}), files, context);
    EXPECT_EQ(count(context, "instance-limit"), 1u);
}

// Few files that each hold many of the next: the number of copies is limited too, and the sides that they bring.
TEST(Instances, CopiesMeetALimit) {
    Files files;
    const int deep = 5, wide = 12; // 12^5 copies
    for (int i = 0; i < deep; ++i) {
        std::string many = vmf_world("");
        for (int k = 0; k < wide; ++k) many += instance(fmt::format("{}.vmf", i + 1), {});
        files[fmt::format("{}.vmf", i)] = many;
    }
    files[fmt::format("{}.vmf", deep)] = vmf_world("");
    Context context;
    assembled(vmf_world("") + instance("0.vmf", {}), files, context);
    EXPECT_GE(count(context, "instance-limit"), 1u);
}

TEST(Instances, SidesMeetALimit) {
    std::string boxes;
    for (int i = 0; i < 20000; ++i) boxes += vmf_box({0, 0, 0}, {1, 1, 1}, 1 + 6 * i);
    Files files{{"part.vmf", vmf_world(boxes)}};
    std::string many = vmf_world("");
    for (int k = 0; k < 36; ++k) many += instance("part.vmf", {}); // 4.3 million sides
    Context context;
    const Document d = assembled(many, files, context);
    EXPECT_EQ(count(context, "instance-limit"), 3u);
    EXPECT_EQ(d.entities[0].brushes.size(), 33u * 20000);
}

// New ids never pass the largest number: they go on with what is free.
TEST(Instances, SideIdsStayPositive) {
    const Document d = assembled(vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, INT32_MAX - 8) + vmf_box({9, 0, 0}, {10, 8, 8}, 3)) + instance("part.vmf", {}) + instance("part.vmf", {}),
                                 {{"part.vmf", vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 100))}});
    std::set<int> ids;
    for (const DocBrush& b : d.entities[0].brushes)
        for (const DocSide& s : b.sides) {
            EXPECT_GT(s.id, 0);
            EXPECT_TRUE(ids.insert(s.id).second) << s.id;
        }
    EXPECT_EQ(ids.size(), 24u);
}

TEST(Instances, UnreadablePlacesAreErrors) {
    Context context;
    const Files files{{"part.vmf", vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1))}};
    const Document d = assembled(vmf_world("") + instance("part.vmf", {{"origin", "1 2"}}) + instance("part.vmf", {{"angles", "0 x 0"}}) + instance("part.vmf", {{"origin", "1e300 0 0"}}), files, context);
    EXPECT_EQ(count(context, "instance-placement"), 3u);
    EXPECT_TRUE(d.entities[0].brushes.empty());
}

TEST(Instances, SideListsNameTheSidesOfTheirOwnInstance) {
    const std::string overlay = vmf_entity("info_overlay", {{"sides", "1 3 99"}, {"BasisOrigin", "4 4 8"}, {"BasisU", "1 0 0"}, {"BasisV", "0 1 0"}, {"BasisNormal", "0 0 1"}});
    const Files files{{"part.vmf", vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1)) + overlay}};
    const Document d = assembled(vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1)) + overlay + instance("part.vmf", {{"origin", "100 0 0"}, {"angles", "0 90 0"}}) + instance("part.vmf", {{"origin", "200 0 0"}}), files);
    std::map<int, int> owner; // side id -> brush
    for (std::size_t b = 0; b < 3; ++b)
        for (const DocSide& s : d.entities[0].brushes[b].sides) EXPECT_TRUE(owner.emplace(s.id, b).second) << "id used twice";
    for (std::size_t i = 0; i < 3; ++i) {
        const std::vector<double> ids = parse_numbers(entity(d, "info_overlay", i).get("sides"));
        ASSERT_EQ(ids.size(), 3u);
        EXPECT_EQ(owner.at(static_cast<int>(ids[0])), static_cast<int>(i));
        EXPECT_EQ(d.entities[0].brushes[i].sides[2].id, static_cast<int>(ids[1]));
        EXPECT_FALSE(owner.contains(static_cast<int>(ids[2]))); // 99 is nobody's, and does not become somebody's
    }
    const DocEntity& turned = entity(d, "info_overlay", 1);
    EXPECT_EQ(turned.get("BasisOrigin"), "96 4 8");
    EXPECT_EQ(turned.get("BasisU"), "0 1 0");
    EXPECT_EQ(turned.get("BasisV"), "-1 0 0");
    EXPECT_EQ(turned.get("BasisNormal"), "0 0 1");
}

TEST(Instances, DiagnosticsOfTheWorldNameTheFileOfTheInstance) {
    const Files files{{"part.vmf", vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1, "wall", "\"lightmapscale\" \"1e9\""))}};
    const Document d = assembled(vmf_world("") + instance("part.vmf", {}), files);
    Context context;
    MaterialDatabase materials;
    const Result<World> world = build_world(d, materials, {}, context);
    ASSERT_TRUE(world);
    EXPECT_EQ(first(context, "lightmap-scale-clamped").where.file, "part.vmf");
    EXPECT_EQ(world->location(SideId{2}).file, "part.vmf");
    EXPECT_EQ(world->location(SideId{2}).line, d.entities[0].brushes[0].sides[2].line);
    EXPECT_EQ(world->location(BrushId{0}).file, "part.vmf");
}

TEST(Instances, GroupsAndCordonsOfInstancesMeanNothing) {
    const Files files{{"part.vmf", vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1)) + "cordon\n{\n\"mins\" \"(-1 -1 -1)\"\n\"maxs\" \"(1 1 1)\"\n\"active\" \"1\"\n}\n"}};
    EXPECT_TRUE(assembled(vmf_world("") + instance("part.vmf", {}), files).cordons.empty());
}

TEST(Manifests, DoNotNest) {
    Context context;
    assembled(vmf_world("") + instance("all.vmm", {}), {{"all.vmm", "\"Maps\"\n{\n\"VMF\"\n{\n\"File\" \"a.vmf\"\n}\n}\n"}}, context);
    EXPECT_NE(first(context, "instance-unreadable").message.find("no other manifests"), std::string::npos);
}

TEST(Manifests, AllMapsJoinUnderThePrimaryWorld) {
    const Files files{{"a.vmf", "world\n{\n\"id\" \"1\"\n\"classname\" \"worldspawn\"\n\"skyname\" \"other\"\n" + vmf_box({0, 0, 0}, {8, 8, 8}, 1) + "}\n"},
                      {"b.vmf", "world\n{\n\"id\" \"1\"\n\"classname\" \"worldspawn\"\n\"skyname\" \"right\"\n" + vmf_box({20, 0, 0}, {28, 8, 8}, 1) + "}\n" +
                                    vmf_entity("info_target", {{"targetname", "t"}, {"origin", "1 2 3"}}, {}, "")}};
    const std::string vmm = "\"manifest\"\n{\n\"Maps\"\n{\n\"VMF\"\n{\n\"Name\" \"A\"\n\"File\" \"a.vmf\"\n}\n\"VMF\"\n{\n\"Name\" \"B\"\n\"File\" \"b.vmf\"\n\"IsPrimary\" \"1\"\n}\n\"VMF\"\n{\n\"File\" \"c.vmf\"\n}\n}\n}\n";
    Context context;
    const Result<Document> d = assemble(file("all.vmm", vmm), opener(files), {}, context);
    ASSERT_TRUE(d);
    EXPECT_EQ(d->entities[0].get("skyname"), "right");
    EXPECT_EQ(d->entities[0].brushes.size(), 2u);
    EXPECT_EQ(entity(*d, "info_target").get("targetname"), "t"); // no prefix
    EXPECT_EQ(count(context, "instance-missing"), 1u);
    EXPECT_EQ(first(context, "instance-missing").where.file, "all.vmm");
    EXPECT_EQ(first(context, "instance-missing").where.line, 18);
    // The bare form of the same.
    EXPECT_TRUE(assemble(file("all.vmm", "Maps { VMF { File a.vmf } }"), opener(files), {}, context));
    EXPECT_FALSE(assemble(file("all.vmm", "Maps { }"), opener(files), {}, context));
    EXPECT_FALSE(assemble(file("all.vmm", "Maps { VMF { File a.vmf }"), opener(files), {}, context));
}

std::string quake_box(Vec3 lo, Vec3 hi) {
    const auto row = [](Vec3 a, Vec3 b, Vec3 c) {
        return fmt::format("( {} {} {} ) ( {} {} {} ) ( {} {} {} ) rock 0 0 0 1 1\n", a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z);
    };
    return "{\n" + row({lo.x, 0, 0}, {lo.x, 1, 0}, {lo.x, 0, 1}) + row({hi.x, 0, 0}, {hi.x, 0, 1}, {hi.x, 1, 0}) + row({0, lo.y, 0}, {0, lo.y, 1}, {1, lo.y, 0}) +
           row({0, hi.y, 0}, {1, hi.y, 0}, {0, hi.y, 1}) + row({0, 0, lo.z}, {1, 0, lo.z}, {0, 1, lo.z}) + row({0, 0, hi.z}, {0, 1, hi.z}, {1, 0, hi.z}) + "}\n";
}

TEST(ExternalMaps, BecomeTheClassTheyAskFor) {
    const Files files{{"part.map", "{\n\"classname\" \"worldspawn\"\n\"message\" \"not mine\"\n" + quake_box({0, 0, 0}, {8, 4, 2}) + "}\n{\n\"classname\" \"func_wall\"\n" + quake_box({10, 0, 0}, {11, 1, 1}) +
                                       "}\n{\n\"classname\" \"light\"\n\"origin\" \"1 2 3\"\n}\n"}};
    const std::string main = "{\n\"classname\" \"worldspawn\"\n}\n{\n\"classname\" \"misc_external_map\"\n\"_external_map\" \"part.map\"\n\"_external_map_classname\" \"func_door\"\n"
                             "\"_external_map_angle\" \"90\"\n\"_external_map_scale\" \"2\"\n\"origin\" \"100 0 0\"\n\"targetname\" \"d\"\n}\n";
    const Document d = assembled(main, files);
    ASSERT_EQ(d.entities.size(), 2u); // the light of the prefab is not taken, as documented by the original
    const DocEntity& door = d.entities[1];
    EXPECT_EQ(door.get("classname"), "func_door");
    EXPECT_EQ(door.get("targetname"), "d");
    EXPECT_EQ(door.get("origin"), "0 0 0");
    EXPECT_EQ(door.find("_external_map"), nullptr);
    ASSERT_EQ(door.brushes.size(), 2u);
    EXPECT_EQ(d.name_of(door.brushes[0].file), "part.map");
    // x of the box becomes y, doubled; y becomes -x.
    EXPECT_EQ(vec(door.brushes[0].sides[1].points[0]).y, 16);
    EXPECT_EQ(vec(door.brushes[0].sides[3].points[0]).x, 100 - 8);
    EXPECT_EQ(vec(door.brushes[0].sides[5].points[0]).z, 4);
    // The texture is as large as it was: locked to the scaled brush.
    const DocTexture& t = door.brushes[0].sides[5].texture;
    EXPECT_NEAR(length(t.u_axis), 0.5, 1e-12);
}

TEST(ExternalMaps, BadScalesAndClassesAreTold) {
    const Files files{{"part.map", "{\n\"classname\" \"worldspawn\"\n" + quake_box({0, 0, 0}, {8, 4, 2}) + "}\n"}};
    Context context;
    const Document d = assembled("{\n\"classname\" \"worldspawn\"\n}\n{\n\"classname\" \"misc_external_map\"\n\"_external_map\" \"part.map\"\n\"_external_map_scale\" \"-1\"\n}\n", files, context);
    EXPECT_EQ(count(context, "external-map-class"), 1u);
    EXPECT_EQ(count(context, "external-map-scale"), 1u);
    EXPECT_EQ(d.entities[1].get("classname"), "func_group");
    EXPECT_EQ(vec(d.entities[1].brushes.at(0).sides[1].points[0]).x, 8);
}

} // namespace
} // namespace kiln::test
