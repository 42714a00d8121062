#include "compiler/assemble/entity_keys.h"
#include "tests/compiler/assemble/files.h"

namespace kiln::test {
namespace {

std::string instance(const Keys& keys, const Keys& outputs = {}) {
    Keys all{{"file", "part.vmf"}};
    all.insert(all.end(), keys.begin(), keys.end());
    return vmf_entity("func_instance", all, outputs);
}
Document with(const std::string& part, const std::string& main, Context& context) { return assembled(vmf_world("") + main, {{"part.vmf", vmf_world("") + part}}, context); }
Document with(const std::string& part, const std::string& main) {
    Context context;
    Document d = with(part, main, context);
    EXPECT_EQ(context.diagnostics().size(), 0u);
    return d;
}

const std::string kRelay = vmf_entity("logic_relay", {{"targetname", "relay"}, {"target", "door"}, {"parentname", "train,attachment"}, {"message", "door"}},
                                      {{"OnTrigger", "door,Open,,0.5,-1"}, {"OnTrigger", "@global,Fire,,0,-1"}, {"OnSpawn", "!self,SetParent,door,0,1"}, {"OnSpawn", "relay,AddOutput,target door,0,1"},
                                       {"OnSpawn", "relay,AddOutput,OnUser1 door:Close::0:-1,0,1"}, {"OnSpawn", "player,Kill,open,0,1"}, {"OnSpawn", "do*\x1BUse\x1B" "a,b\x1B" "0\x1B" "1"}}) +
                           vmf_entity("func_door", {{"targetname", "door"}});

TEST(Names, PrefixReachesKeysOutputsAndParameters) {
    const Document d = with(kRelay, instance({{"targetname", "inst"}, {"fixup_style", "0"}}));
    const DocEntity& e = entity(d, "logic_relay");
    EXPECT_EQ(e.get("targetname"), "inst-relay");
    EXPECT_EQ(e.get("target"), "inst-door");
    EXPECT_EQ(e.get("parentname"), "inst-train,attachment");
    EXPECT_EQ(e.get("message"), "door"); // no name
    EXPECT_EQ(outputs(e, "OnTrigger"), (std::vector<std::string>{"inst-door,Open,,0.5,-1", "@global,Fire,,0,-1"}));
    EXPECT_EQ(outputs(e, "OnSpawn"), (std::vector<std::string>{"!self,SetParent,inst-door,0,1", "inst-relay,AddOutput,target inst-door,0,1", "inst-relay,AddOutput,OnUser1 inst-door:Close::0:-1,0,1",
                                                              "player,Kill,open,0,1", "inst-do*\x1BUse\x1B" "a,b\x1B" "0\x1B" "1"}));
}

TEST(Names, PostfixNoneAndAutomatic) {
    EXPECT_EQ(entity(with(kRelay, instance({{"targetname", "i"}, {"fixup_style", "1"}})), "logic_relay").get("target"), "door-i");
    EXPECT_EQ(entity(with(kRelay, instance({{"targetname", "i"}, {"fixup_style", "1"}})), "logic_relay").get("parentname"), "train-i,attachment");
    EXPECT_EQ(entity(with(kRelay, instance({{"targetname", "i"}, {"fixup_style", "2"}})), "logic_relay").get("target"), "door");
    const Document d = with(kRelay, instance({}) + instance({}));
    EXPECT_EQ(entity(d, "logic_relay", 0).get("targetname"), "InstanceAuto1-relay");
    EXPECT_EQ(entity(d, "logic_relay", 1).get("targetname"), "InstanceAuto2-relay");
}

TEST(Names, ClassesAsTargetsStayUnlessSomethingIsCalledSo) {
    const std::string part = vmf_entity("logic_auto", {}, {{"OnMapSpawn", "func_door,Open,,0,-1"}, {"OnMapSpawn", "env_fire,Start,,0,-1"}}) + vmf_entity("func_door", {{"targetname", "x"}}) +
                             vmf_entity("env_fire", {{"targetname", "env_fire"}});
    const Document d = with(part, instance({{"targetname", "i"}}));
    EXPECT_EQ(outputs(entity(d, "logic_auto"), "OnMapSpawn"), (std::vector<std::string>{"func_door,Open,,0,-1", "i-env_fire,Start,,0,-1"}));
}

TEST(Names, ReplacementsReachKeysOutputsMaterialsAndNestedInstances) {
    const Files files{{"part.vmf", vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1, "$mat")) + vmf_entity("light", {{"_light", "$colour 200"}, {"style", "$style"}, {"$custom", "1"}}, {{"OnFire", "t,Do,$COLOURED,0,-1"}}) +
                                       vmf_entity("func_instance_parms", {{"parm1", "$style integer 5"}, {"parm2", "$colour color255 9 9 9"}}) +
                                       vmf_entity("func_instance", {{"file", "$inner"}, {"replace01", "$name $style"}, {"targetname", "n"}})},
                      {"inner.vmf", vmf_world(vmf_box({0, 0, 0}, {8, 8, 8}, 1, "tools/Old")) + vmf_entity("info_target", {{"message", "is $name"}})}};
    const Document d = assembled(vmf_world("") + vmf_entity("func_instance", {{"file", "part.vmf"}, {"targetname", "i"}, {"replace01", "$colour 255 0 10"}, {"replace02", "$coloured yes"}, {"replace03", "$mat brick/red"},
                                                                             {"replace04", "$custom _key"}, {"replace05", "$inner inner.vmf"}, {"replace06", "#tools\\old dev/new"}}),
                                 files);
    const DocEntity& light = entity(d, "light");
    EXPECT_EQ(light.get("_light"), "255 0 10 200");
    EXPECT_EQ(light.get("style"), "5"); // the default of func_instance_parms
    EXPECT_EQ(light.get("_key"), "1");
    EXPECT_EQ(outputs(light, "OnFire"), std::vector<std::string>{"i-t,Do,yes,0,-1"}); // the longer variable, whatever its case
    EXPECT_EQ(d.entities[0].brushes.at(0).sides[0].material, "brick/red");
    EXPECT_EQ(entity(d, "info_target").get("message"), "is 5");
    EXPECT_EQ(d.entities[0].brushes.at(1).sides[0].material, "tools/Old"); // not handed on to what is nested
    for (const DocEntity& e : d.entities) EXPECT_NE(e.get("classname"), "func_instance_parms");
    const Document e = assembled(vmf_world("") + vmf_entity("func_instance", {{"file", "inner.vmf"}, {"replace06", "#tools\\old dev/new"}}), files);
    EXPECT_EQ(e.entities[0].brushes.at(0).sides[0].material, "dev/new");
}

TEST(Names, ReplacementsReachPatches) {
    const std::string part = "{\n\"classname\" \"worldspawn\"\n{\npatchDef2\n{\n$tex\n( 3 3 0 0 0 )\n(\n( ( 0 0 0 0 0 ) ( 0 8 0 0 1 ) ( 0 16 0 0 2 ) )\n( ( 8 0 0 1 0 ) ( 8 8 0 1 1 ) ( 8 16 0 1 2 ) )\n"
                             "( ( 16 0 0 2 0 ) ( 16 8 0 2 1 ) ( 16 16 0 2 2 ) )\n)\n}\n}\n}\n";
    const Document d = assembled(vmf_world("") + vmf_entity("func_instance", {{"file", "part.map"}, {"replace01", "$tex brick/wall"}}), {{"part.map", part}});
    ASSERT_EQ(d.entities[0].patches.size(), 1u);
    EXPECT_EQ(d.entities[0].patches[0].material, "brick/wall");
}

// Each file hands on twice what it was given: the text keeps its variables where it would outgrow all memory, and that is told.
TEST(Names, ReplacementsThatDoubleMeetALimit) {
    Files files;
    for (int i = 0; i < 40; ++i) files[fmt::format("{}.vmf", i)] = vmf_world("") + vmf_entity("func_instance", {{"file", fmt::format("{}.vmf", i + 1)}, {"replace01", fmt::format("$v{} $v{}$v{}", i + 1, i, i)}});
    files["40.vmf"] = vmf_world("") + vmf_entity("info_target", {{"message", "$v40"}});
    Context context;
    const Document d = assembled(vmf_world("") + vmf_entity("func_instance", {{"file", "0.vmf"}, {"replace01", "$v0 0123456789"}}), files, context);
    EXPECT_GE(count(context, "instance-limit"), 1u);
    EXPECT_LE(entity(d, "info_target").get("message").size(), std::size_t{1} << 17);
    EXPECT_EQ(first(context, "instance-limit").where.file.ends_with(".vmf"), true);
}

TEST(Outputs, GoThroughTheWallsOfAnInstance) {
    const std::string part = vmf_entity("func_button", {{"targetname", "button"}}) + vmf_entity("logic_relay", {{"targetname", "relay"}});
    const Document d = with(part, instance({{"targetname", "i"}}, {{"instance:button;OnPressed", "door,Open,,0,-1"}}) +
                                      vmf_entity("logic_auto", {}, {{"OnMapSpawn", "i,instance:relay;Trigger,,1,-1"}}));
    EXPECT_EQ(outputs(entity(d, "func_button"), "OnPressed"), std::vector<std::string>{"door,Open,,0,-1"});
    EXPECT_EQ(outputs(entity(d, "logic_auto"), "OnMapSpawn"), std::vector<std::string>{"i-relay,Trigger,,1,-1"});
}

TEST(Outputs, ThatNameNobodyAreTold) {
    Context context;
    with(vmf_entity("logic_relay", {{"targetname", "relay"}}), instance({{"targetname", "i"}}, {{"instance:nobody;OnPressed", "door,Open,,0,-1"}}) +
         vmf_entity("logic_auto", {}, {{"OnMapSpawn", "i,instance:nobody;Trigger,,1,-1"}, {"OnMapSpawn", "j,instance:relay;Trigger,,1,-1"}}), context);
    EXPECT_EQ(count(context, "instance-output-unknown"), 3u);
}

TEST(Outputs, ProxiesAreResolved) {
    // In: button -> proxy -> outside. Out: outside -> proxy -> relay. The proxy itself goes.
    const std::string part = vmf_entity("func_button", {{"targetname", "button"}}, {{"OnPressed", "proxy,ProxyRelay1,arg,1,1"}}) +
                             vmf_entity("func_instance_io_proxy", {{"targetname", "proxy"}}, {{"OnProxyRelay2", "relay,Trigger,,0.25,-1"}}) + vmf_entity("logic_relay", {{"targetname", "relay"}});
    const Document d = with(part, instance({{"targetname", "i"}}, {{"instance:proxy;OnProxyRelay1", "door,Open,,0.5,-1"}, {"instance:proxy;OnProxyRelay1", "lamp,TurnOn,,0,-1"}}) +
                                      vmf_entity("logic_auto", {}, {{"OnMapSpawn", "i,instance:proxy;ProxyRelay2,,1,-1"}}));
    EXPECT_EQ(outputs(entity(d, "func_button"), "OnPressed"), (std::vector<std::string>{"door,Open,arg,1.5,1", "lamp,TurnOn,arg,1,1"}));
    EXPECT_EQ(outputs(entity(d, "logic_auto"), "OnMapSpawn"), std::vector<std::string>{"i-relay,Trigger,,1.25,-1"});
    for (const DocEntity& e : d.entities) EXPECT_NE(e.get("classname"), "func_instance_io_proxy");
}

Document turned(const std::string& part, const std::string& angles = "0 90 0") { return with(part, instance({{"angles", angles}, {"origin", "100 0 0"}, {"targetname", "i"}})); }

TEST(Keys, PointsAnglesAndBoxesTurn) {
    const std::string part = vmf_entity("phys_hinge", {{"origin", "1 2 3"}, {"hingeaxis", "1 2 3, 1 2 9"}, {"attach1", "a"}}) +
                             vmf_entity("func_useableladder", {{"point0", "1.25 0 0"}, {"point1", "0 0 64"}}) + vmf_entity("trigger_push", {{"pushdir", "0 90 0"}}) +
                             vmf_entity("env_fog_controller", {{"fogdir", "1 0 0"}, {"mins", "-1 -2 -3"}, {"maxs", "4 5 6"}}) + vmf_entity("prop_static", {{"origin", "0 0 0"}, {"angles", "10 20 30"}}) +
                             vmf_entity("broken", {{"origin", "1 2"}, {"angles", "x"}});
    const Document d = turned(part);
    EXPECT_EQ(entity(d, "phys_hinge").get("origin"), "98 1 3");
    EXPECT_EQ(entity(d, "phys_hinge").get("hingeaxis"), "98 1 3, 98 1 9");
    EXPECT_EQ(entity(d, "phys_hinge").get("attach1"), "i-a");
    EXPECT_EQ(entity(d, "func_useableladder").get("point0"), "100 1.25 0");
    EXPECT_EQ(entity(d, "func_useableladder").get("point1"), "100 0 64");
    EXPECT_EQ(entity(d, "trigger_push").get("pushdir"), "0 180 0");
    EXPECT_EQ(entity(d, "env_fog_controller").get("fogdir"), "0 1 0");
    EXPECT_EQ(entity(d, "env_fog_controller").get("mins"), "-5 -1 -3");
    EXPECT_EQ(entity(d, "env_fog_controller").get("maxs"), "2 4 6");
    EXPECT_EQ(entity(d, "prop_static").get("angles"), "10 110 30");
    EXPECT_EQ(entity(d, "broken").get("origin"), "1 2"); // what cannot be read stays
    EXPECT_EQ(entity(d, "broken").get("angles"), "x");
}

// Where a light with a direction looks, by the rules of the engine: pitch wins over the first angle, up is positive.
Vec3 light_direction(const DocEntity& e) {
    const Vec3 a = e.vector("angles", {});
    double pitch = e.number("pitch", 0);
    if (pitch == 0) pitch = a.x;
    return assemble_detail::operator*(assemble_detail::matrix_of_angles({-pitch, a.y, 0}), Vec3{1, 0, 0});
}
TEST(Keys, LightsLookWhereTheirInstanceTurnsThem) {
    for (const Keys& keys : {Keys{{"angles", "0 45 0"}, {"pitch", "-90"}}, Keys{{"angles", "-30 45 0"}, {"pitch", "-30"}}, Keys{{"angles", "20 0 0"}}, Keys{{"angles", "0 0 0"}, {"pitch", "0"}}})
        for (const Vec3 angles : {Vec3{0, 90, 0}, Vec3{90, 0, 0}, Vec3{0, 0, 180}, Vec3{30, 50, 70}}) {
            const std::string light = vmf_entity("light_spot", keys);
            const DocEntity before = entity(with(light, instance({})), "light_spot");
            const DocEntity after = entity(turned(light, fmt::format("{} {} {}", angles.x, angles.y, angles.z)), "light_spot");
            const Vec3 wanted = assemble_detail::operator*(assemble_detail::matrix_of_angles(angles), light_direction(before));
            EXPECT_LT(length(light_direction(after) - wanted), 1e-6) << after.get("angles") << " / " << after.get("pitch");
        }
}

TEST(Keys, AxesOfRotatingEntitiesAreToldByFlags) {
    const std::string part = vmf_entity("func_rotating", {{"spawnflags", "1"}});
    EXPECT_EQ(entity(turned(part, "0 90 0"), "func_rotating").get("spawnflags"), "1"); // about z still
    EXPECT_EQ(entity(turned(part, "90 0 0"), "func_rotating").get("spawnflags"), "5"); // z becomes x
    EXPECT_EQ(entity(turned(part, "0 0 90"), "func_rotating").get("spawnflags"), "11"); // z becomes -y: reversed
    EXPECT_EQ(entity(turned(part, "180 0 0"), "func_rotating").get("spawnflags"), "3"); // z becomes -z
    EXPECT_EQ(entity(turned(vmf_entity("func_door_rotating", {{"spawnflags", "64"}}), "0 90 0"), "func_door_rotating").get("spawnflags"), "128");
    Context context;
    const Document d = with(part, instance({{"angles", "0 0 45"}}), context);
    EXPECT_EQ(count(context, "instance-turned-axis"), 1u);
    EXPECT_EQ(entity(d, "func_rotating").get("spawnflags"), "1");
}

TEST(Keys, NodesStayUnique) {
    const std::string node = vmf_entity("info_node", {{"nodeid", "4"}}) + vmf_entity("info_node_link", {{"startnode", "4"}, {"endnode", "5"}}) + vmf_entity("info_node", {{"nodeid", "5"}});
    const Document d = with(node, vmf_entity("info_node", {{"nodeid", "4"}}) + instance({}) + instance({}));
    for (std::size_t i = 0; i < 2; ++i) {
        const DocEntity& link = entity(d, "info_node_link", i);
        EXPECT_EQ(link.get("startnode"), entity(d, "info_node", 1 + 2 * i).get("nodeid"));
        EXPECT_EQ(link.get("endnode"), entity(d, "info_node", 2 + 2 * i).get("nodeid"));
        EXPECT_NE(link.get("startnode"), "4");
    }
}

TEST(Keys, NumbersAreShort) {
    using assemble_detail::number_text;
    EXPECT_EQ(number_text(-0.0), "0");
    EXPECT_EQ(number_text(1e-9), "0");
    EXPECT_EQ(number_text(90), "90");
    EXPECT_EQ(number_text(-12.5), "-12.5");
    EXPECT_EQ(number_text(1.0 / 3), "0.333333");
    EXPECT_EQ(number_text(123456), "123456");
}

} // namespace
} // namespace kiln::test
