// trace: why two places can see each other, as a line of sight or as the chain of portals that visibility goes.
#include "formats/portal_file/portal_file.h"
#include "libs/core/file.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/dump_rows.h"
#include <charconv>
#include <fmt/format.h>

namespace kiln {
namespace {

struct Place {
    std::optional<Vec3> point;
    std::uint32_t cluster = 0;
};
// "12" is a cluster, "64,-128,24" a point.
std::optional<Place> place_of(const std::string& text) {
    Place p;
    const char *at = text.data(), *end = at + text.size();
    if (text.find(',') == std::string::npos) {
        const auto [stop, error] = std::from_chars(at, end, p.cluster);
        return error == std::errc{} && stop == end ? std::optional(p) : std::nullopt;
    }
    Vec3 v;
    for (std::size_t k = 0; k < 3; ++k) {
        const auto [stop, error] = std::from_chars(at, end, v[k]);
        if (error != std::errc{} || !(std::abs(v[k]) <= 1e6) || (k < 2 ? stop == end || *stop != ',' : stop != end)) return std::nullopt;
        at = stop + 1;
    }
    p.point = v;
    return p;
}
Vec3 middle(const std::vector<Vec3>& w) {
    Vec3 sum{};
    for (const Vec3& p : w) sum += p;
    return sum / static_cast<double>(std::max<std::size_t>(1, w.size()));
}

} // namespace

Command trace_command(CLI::App& app) {
    struct Options { BakeOptions bake; std::string from, to, output; bool json = false; };
    auto o = std::make_shared<Options>();
    const auto check = [](const std::string& text) { return place_of(text) ? std::string() : "a place is a cluster's number, or a point as X,Y,Z"; };
    app.add_option("from", o->from, "A cluster's number, or a point: X,Y,Z")->required()->check(check);
    app.add_option("to", o->to, "The same")->required()->check(check);
    o->bake.add_to(app);
    app.add_option("-o,--output", o->output, "Write the line, or the way through the chain of portals, as a trail that editors show: .lin or .pts")->type_name("FILE");
    app.add_flag("--json", o->json, "As JSON");
    app.footer("examples:\n  kiln trace 12 40 m.vmf -o m.lin                 why cluster 12 sees cluster 40\n  kiln trace 64,0,24 900,-32,24 e1m1.map          the same of two points\n"
               "  kiln trace -- -64,0,24 900,-32,24 e1m1.map      a point that begins with a minus");
    return [o]() -> int {
        Console console;
        o->bake.settle(console);
        Context context = console.make_context(o->bake.thread_count());
        const auto wrong = [&](const std::string& what) { return console.fail(fault(Exit::usage, "usage", what, {.file = o->bake.map})); };
        const bool pts = o->output.ends_with(".pts");
        if (!o->output.empty() && !pts && !o->output.ends_with(".lin")) return wrong("a trail is .lin or .pts");
        if (o->bake.compile.vis_merge >= 0 && !(place_of(o->from)->point && place_of(o->to)->point)) return wrong("--vis-merge numbers clusters anew: name points");
        Compiled c;
        if (const int code = compile_map(o->bake, console, context, Stage::bsp, c); code != 0) return code;
        Place places[2] = {*place_of(o->from), *place_of(o->to)};
        for (Place& p : places) {
            if (p.point) {
                const ClusterId cluster = c.bsp.leaves[leaf_at(c.bsp, *p.point).at()].cluster;
                if (!cluster.valid()) return wrong(fmt::format("the point {:g} {:g} {:g} is in no cluster: solid, or outside", p.point->x, p.point->y, p.point->z));
                p.cluster = cluster.value;
            }
            if (p.cluster >= c.bsp.cluster_count) return wrong(fmt::format("there is no cluster {}: the map has {}", p.cluster, c.bsp.cluster_count));
        }
        VisibilityOptions sight = o->bake.compile.visibility;
        sight.radius = std::max(0.0, sight.radius);
        const auto chain = find_sight(c.portals, c.bsp.cluster_count, places[0].cluster, places[1].cluster, sight, context);
        std::vector<Vec3> path;
        Json portals = Json::array();
        if (chain) {
            if (places[0].point) path.push_back(*places[0].point);
            for (const std::uint32_t p : chain->portals) {
                const VisPortal& portal = c.portals[p / 2];
                const Vec3 at = middle(portal.winding);
                portals.push_back({{"portal", p / 2}, {"from", p % 2 ? portal.cluster_back : portal.cluster_front}, {"to", p % 2 ? portal.cluster_front : portal.cluster_back}, {"at", to_json(at)}});
                if (chain->line.empty()) path.push_back(at);
            }
            path.insert(path.end(), chain->line.begin(), chain->line.end());
            if (places[1].point) path.push_back(*places[1].point);
            if (!chain->line.empty()) path = chain->line; // the line itself, not the bends to the points asked for
        }
        if (!o->output.empty()) {
            if (path.empty()) console.say(chain ? "one cluster: there is no line to write" : "they do not see each other: there is no line to write");
            else if (const auto written = write_file(o->output, pts ? write_pts(path) : write_lin(path)); !written) return console.fail(written.fault());
        }
        std::string text;
        if (o->json) {
            Json line = Json::array();
            if (chain)
                for (const Vec3& p : chain->line) line.push_back(to_json(p));
            text = Json{{"from", places[0].cluster}, {"to", places[1].cluster}, {"sees", chain.has_value()}, {"line", line}, {"portals", portals}}.dump(2) + "\n";
        } else {
            text = !chain                ? fmt::format("clusters {} and {} do not see each other\n", places[0].cluster, places[1].cluster)
                   : portals.empty()     ? fmt::format("both are in cluster {}\n", places[0].cluster)
                   : chain->line.empty() ? fmt::format("cluster {} may see cluster {}: no line was found, but visibility cannot rule out this chain of portals\n", places[0].cluster, places[1].cluster)
                                         : fmt::format("cluster {} sees cluster {} along {:g} {:g} {:g} to {:g} {:g} {:g}\n", places[0].cluster, places[1].cluster, chain->line[0].x, chain->line[0].y,
                                                       chain->line[0].z, chain->line[1].x, chain->line[1].y, chain->line[1].z);
            for (const Json& p : portals) text += fmt::format("  portal {:>5}  cluster {:>5} to {:>5}  {}\n", p["portal"].get<int>(), p["from"].get<int>(), p["to"].get<int>(), p["at"].dump());
        }
        if (const int code = print_output(text); code != 0) return code;
        return console.verdict(context);
    };
}

} // namespace kiln
