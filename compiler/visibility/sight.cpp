// Why one cluster sees another: the chain of portals the flow goes, and a line through it.
#include "compiler/visibility/flow.h"
#include "compiler/visibility/proven.h"
#include "libs/sampling/sobol.h"
#include <algorithm>

namespace kiln {

using namespace vis;

namespace {

constexpr int kLines = 20000; // that are tried

// A line through all portals of the chain, from the first to the last.
std::vector<Vec3> line_through(std::span<const Directed> portals, const Windows& windows, const SightChain& chain) {
    Random random(chain.portals.size());
    for (int i = 0; i < kLines; ++i) {
        const Vec3 a = point_in(chain.source, random), b = point_in(chain.pass, random);
        const Vec3 n = portals[chain.portals[0]].plane.normal; // neighbours: straight through, a unit to either side
        const bool alone = chain.portals.size() == 1;
        if (windows.line(chain.portals, a, alone ? n : b - a)) return alone ? std::vector{a - n, a + n} : std::vector{a, b};
    }
    return {};
}

} // namespace

std::optional<SightChain> find_sight(std::span<const VisPortal> map_portals, std::uint32_t cluster_count, std::uint32_t from, std::uint32_t to, const VisibilityOptions& options, Context& context) {
    if (from >= cluster_count || to >= cluster_count) return std::nullopt;
    if (from == to) return SightChain{};
    const DirectedPortals directed = directed_portals(map_portals);
    const std::span<const Directed> portals = directed.ways;
    const Exits exits = exits_of(portals, cluster_count);
    const Windows windows(directed);
    std::optional<SightChain> found;
    const auto offer = [&](SightChain chain) { // one with a line is what is wanted, then one of few portals
        chain.line = line_through(portals, windows, chain);
        if (!found || (found->line.empty() && (!chain.line.empty() || chain.portals.size() < found->portals.size()))) found = std::move(chain);
        return !found->line.empty();
    };
    for (const std::uint32_t p : exits.of(from))
        if (portals[p].to == to && offer({{p}, *portals[p].winding, *portals[p].winding, {}})) return found;
    if (found) return found; // neighbours by a portal without area
    const std::function<bool()> stop = [&] { return context.cancelled(); };
    const SparseRows reach = flood(directed, exits, options.radius, stop, context);
    const Passages none(directed, exits, reach, options.epsilon, 0, stop, context);
    const FlowInput input{&directed, &exits, &windows, &reach, &none, options.epsilon, &stop};
    for (const std::uint32_t p : exits.of(from)) {
        context.check_cancelled();
        // Everything but the ways into `to` counts as seen already: the flow searches for these alone. A chain through which
        // no line was found is not the last word: another may have one.
        std::vector<std::uint64_t> seen(reach.words(), ~std::uint64_t{0});
        for (std::uint32_t q = 0; q < portals.size(); ++q)
            if (portals[q].to == to) clear_bit(seen.data(), q);
        for (;;) {
            FlowFound found_here;
            SightChain chain;
            if (Flow(input, p, seen.data()).go(options.step_budget, seen.data(), found_here, &chain) == FlowEnd::stopped) context.check_cancelled();
            if (chain.portals.empty()) break;
            if (offer(std::move(chain))) return found;
        }
    }
    return found;
}

} // namespace kiln
