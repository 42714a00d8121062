// vis: the visibility stage alone, on a map or on the portals of another compiler.
#include "libs/core/file.h"
#include "libs/core/process.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/dump_rows.h"
#include "tools/kiln/foreign_portals.h"
#include <bit>
#include <chrono>
#include <fmt/format.h>
#include <numeric>

namespace kiln {
namespace {

std::string indented_text(const Json& j, const std::string& indent = "") {
    std::string out;
    for (const auto& [key, value] : j.items()) {
        if (value.is_object()) out += fmt::format("{}{}\n{}", indent, key, indented_text(value, indent + "  "));
        else if (!value.is_array() || !value.empty())
            out += fmt::format("{}{:<16} {}\n", indent, key, value.is_string() ? value.get<std::string>() : value.is_number_float() ? fmt::format("{:.2f}", value.get<double>())  : value.is_array() ? fmt::format("{}", value.size()) : value.dump());
    }
    return out;
}

} // namespace

bool is_portal_file(std::span<const std::uint8_t> bytes) { return bytes.size() >= 3 && bytes[0] == 'P' && bytes[1] == 'R' && bytes[2] == 'T'; }

Result<ForeignPortals> read_foreign_portals(std::span<const std::uint8_t> bytes, const std::string& name, Context& context) {
    const auto file = read_portal_file(bytes, name);
    if (!file) return file.fault();
    // Each cluster takes a row whether anything leads there or not: a count must be borne out by the portals.
    if (constexpr std::size_t kAlone = 1 << 16; file->cluster_count > 2 * file->portals.size() + kAlone)
        return fault(Exit::input, "portal-file-cluster", fmt::format("{} clusters, but {} portals: most of them lead nowhere", file->cluster_count, file->portals.size()),
                     {.file = name, .line = bytes.size() > 3 && bytes[3] == '2' ? 3 : 2});
    ForeignPortals out{vis_portals(*file), file->cluster_count, file->leaf_cluster};
    if (out.given.turned)
        context.report(Severity::warning, "portal-file-turned", "windings face the second cluster of their portal throughout, against the format; they are turned", {.file = name});
    if (out.given.flatness > VisibilityOptions{}.epsilon)
        context.report(Severity::warning, "portal-file-flat", fmt::format("points lie up to {:.3g} map units from the plane of their portal, more than clips leave standing: what is seen there alone may be missed", out.given.flatness), {.file = name});
    if (out.given.not_convex)
        context.report(Severity::warning, "portal-file-convex", fmt::format("the windings of {} portals are not convex, the first of them portal {} (counted from 0): what is seen there alone may be missed", out.given.not_convex, out.given.first_not_convex), {.file = name});
    return out;
}

std::optional<MergedClusters> merge_foreign(const Visibility& visibility, const ForeignPortals& of, double percent, Context& context) {
    if (percent < 0) return std::nullopt;
    std::vector<std::uint32_t> leaves(of.cluster_count, of.leaf_cluster.empty() ? 1 : 0);
    for (const std::uint32_t c : of.leaf_cluster)
        if (c < of.cluster_count) ++leaves[c];
    std::vector<std::array<std::uint32_t, 2>> neighbours, apart;
    for (std::size_t i = 0; i < of.given.portals.size(); ++i) {
        const VisPortal& p = of.given.portals[i];
        (of.given.hint[i] ? apart : neighbours).push_back({p.cluster_front, p.cluster_back});
    }
    return merge_clusters(visibility, leaves, neighbours, apart, percent, context);
}

Rows vis_rows(const Visibility& v) {
    Rows rows;
    for (std::uint32_t a = 0; a < v.cluster_count; ++a) {
        Json seen = Json::array();
        for (std::uint32_t b = 0; b < v.cluster_count; ++b)
            if (v.sees(a, b)) seen.push_back(b);
        rows.push_back({{"cluster", a}, {"count", seen.size()}, {"sees", seen}});
        if (v.shut.empty()) continue;
        Json shut = Json::array();
        for (std::uint32_t b = 0; b < v.cluster_count; ++b)
            if (v.sees_shut(a, b)) shut.push_back(b);
        rows.back()["shut"] = std::move(shut);
    }
    return rows;
}

Command vis_command(CLI::App& app) {
    struct Options { BakeOptions bake; std::string output, prt; bool json = false; };
    auto o = std::make_shared<Options>();
    o->bake.add_to(app);
    app.get_option("map")->description("A map (.vmf, .vmm, .map), or a portal file (.prt: PRT1, PRT2, PRT1-AM) of any compiler");
    app.add_flag("--json", o->json, "As JSON");
    app.add_option("-o,--output", o->output, "Write the rows as JSON: an array, a cluster a line, as `kiln dump vis --json` does")->type_name("FILE");
    app.add_option("--prt", o->prt, "Write the portals as a portal file: PRT2 where several leaves share a cluster, else PRT1")->type_name("FILE");
    app.footer("examples:\n  kiln vis other.prt                        how much is seen, and how long it took to know\n"
               "  kiln vis other.prt -o rows.json --json\n  kiln vis e1m1.map --prt e1m1.prt --fast-vis");
    return [o]() -> int {
        Console console;
        o->bake.settle(console);
        Context context = console.make_context(o->bake.thread_count());
        for (const std::string& written : {o->output, o->prt})
            if (same_file(written, o->bake.map)) return console.fail(fault(Exit::usage, "usage", "the output is the input itself", {.file = written}));
        const auto bytes = read_file(o->bake.map);
        if (!bytes) return console.fail(bytes.fault());

        std::vector<VisPortal> portals;
        std::uint32_t cluster_count = 0;
        std::vector<std::uint32_t> leaf_cluster; // of leaves that are in one
        Visibility visibility;
        std::optional<MergedClusters> merged;
        Json input = {{"file", o->bake.map}};
        auto wall = std::chrono::steady_clock::now();
        double cpu = cpu_seconds();
        if (is_portal_file(*bytes)) {
            auto file = read_foreign_portals(*bytes, o->bake.map, context);
            if (!file) return console.fail(file.fault());
            const FilePortals& given = file->given;
            portals = given.portals, cluster_count = file->cluster_count, leaf_cluster = file->leaf_cluster;
            input["format"] = "prt", input["flatness"] = given.flatness, input["without_area"] = given.without_area, input["turned"] = given.turned;
            wall = std::chrono::steady_clock::now(), cpu = cpu_seconds();
            VisibilityOptions sight = o->bake.compile.visibility;
            sight.radius = std::max(sight.radius, 0.0);
            auto computed = compute_visibility(portals, cluster_count, sight, context, {.seconds = o->bake.vis_budget});
            console.print_new(context);
            if (!computed) return console.fail(computed.fault());
            visibility = *std::move(computed);
            merged = merge_foreign(visibility, *file, o->bake.compile.vis_merge, context);
        } else {
            Compiled c;
            if (const int code = compile_map(o->bake, console, context, Stage::visibility, c); code != 0) return code;
            input["format"] = "map";
            portals = std::move(c.portals), cluster_count = c.bsp.cluster_count, visibility = std::move(c.visibility), merged = std::move(c.merged);
            for (const BspLeaf& l : c.bsp.leaves)
                if (l.cluster.valid()) leaf_cluster.push_back(l.cluster.value);
            cpu = cpu_seconds() - c.stages.back().cpu_s;
            wall = std::chrono::steady_clock::now() - std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(c.stages.back().wall_s));
        }
        const double cpu_s = cpu_seconds() - cpu, wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count();

        std::vector<std::uint32_t> in = leaf_cluster; // the clusters that are written and counted
        if (merged) {
            if (in.empty()) in.resize(cluster_count), std::iota(in.begin(), in.end(), 0u);
            for (std::uint32_t& c : in) c = c == UINT32_MAX ? c : merged->of[c];
        }
        const Visibility& shown = merged ? merged->visibility : visibility;
        const VisibilitySummary s = summary(shown, in);
        Json loose = Json::array();
        for (const std::uint32_t p : visibility.loose) loose.push_back({{"portal", p}, {"front", portals[p].cluster_front}, {"back", portals[p].cluster_back}, {"at", to_json(portals[p].winding[0])}});
        Json j = {{"input", input},
                        {"clusters", s.clusters}, {"leaves", s.leaves}, {"portals", portals.size()},
                        {"seen", {{"mean_clusters", s.mean}, {"mean_leaves", s.mean_leaves}, {"least", s.least}, {"most", s.most}, {"pairs", s.pairs}}},
                        {"steps", visibility.steps}, {"loose_portals", loose},
                        {"time", {{"cpu_s", cpu_s}, {"wall_s", wall_s}, {"threads", context.threads}}}};
        if (!shown.shut.empty()) {
            std::uint64_t pairs = 0;
            for (const std::uint64_t w : shown.shut) pairs += static_cast<std::uint64_t>(std::popcount(w));
            j["shut"] = {{"mean_clusters", static_cast<double>(pairs) / shown.cluster_count}, {"pairs", pairs}}; // area portals
        }
        if (!o->output.empty()) {
            std::string rows = "[\n";
            const Rows all = vis_rows(shown);
            for (std::size_t a = 0; a < all.size(); ++a) rows += all[a].dump() + (a + 1 < all.size() ? ",\n" : "\n");
            if (const auto written = write_file(o->output, rows + "]\n"); !written) return console.fail(written.fault());
        }
        if (!o->prt.empty()) {
            PortalFile file;
            file.cluster_count = shown.cluster_count;
            const auto now = [&](std::uint32_t c) { return merged ? merged->of[c] : c; };
            for (const VisPortal& p : portals)
                if (!merged || now(p.cluster_front) != now(p.cluster_back)) file.portals.push_back({now(p.cluster_front), now(p.cluster_back), p.winding, false});
            if (in.size() > shown.cluster_count) file.leaf_cluster = in;
            if (const auto written = write_file(o->prt, write_portal_file(file)); !written) return console.fail(written.fault());
        }
        if (const int code = print_output(o->json ? j.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n" : indented_text(j)); code != 0) return code;
        return console.verdict(context);
    };
}

} // namespace kiln
