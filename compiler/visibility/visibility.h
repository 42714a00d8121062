// Which clusters may see which: portal flow with separating planes.
//
// In       portals: convex, counter-clockwise seen from leaf_front, map units; clusters by leaf
// Out      rows: one bit row per cluster, padded to 64 bits; reflexive, symmetric and conservative
//          (a 0 bit means no open segment joins the two clusters)
// Errors   a portal naming a missing cluster
// Source   S. Teller, "Visibility Computations in Densely Occluded Polyhedral Environments", PhD thesis,
//          Berkeley 1992; waves instead of "whatever thread is done": NOTES.md
#pragma once
#include "compiler/bsp/bsp.h"
#include <optional>
#include <span>

namespace kiln {

struct VisPortal {
    std::uint32_t cluster_front = 0, cluster_back = 0;
    std::vector<Vec3> winding; // CCW seen from the front cluster
    template <class A> void fields(A& a) { a(cluster_front, cluster_back, winding); }
};

struct VisibilityOptions {
    bool fast = false;         // no flow: valid, looser
    double epsilon = 1e-3;     // map units; rounding may only open portals, never close them
    std::uint64_t step_budget = 0;  // flow steps per way through a portal, 0: no limit; one over budget keeps its loose set
    std::uint64_t total_budget = 0; // flow steps of all together, 0: no limit; shared out so that the same ones are left every time
    std::uint32_t rays = 128;  // per way through a portal, that prove pairs beforehand: time, not rows, depends on it
    double radius = -1;        // map units: nothing is seen that is farther away. 0: no limit; below: as the map says (compile)
    template <class A> void fields(A& a) { a(fast, epsilon, step_budget, total_budget, rays, radius); }
};

struct Visibility {
    std::uint32_t cluster_count = 0;
    std::vector<std::uint32_t> loose; // portals that the budget left with a loose set on one way at least, ascending
    std::uint64_t steps = 0;          // of the flow, in all
    std::vector<std::uint64_t> rows;  // cluster_count * words_per_row
    std::vector<std::uint64_t> shut;  // the same while area portals are shut (shut.h); empty: none parts areas
    template <class A> void fields(A& a) { a(cluster_count, loose, steps, rows, shut); }
    std::size_t words_per_row() const { return (cluster_count + 63) / 64; }
    bool sees(std::uint32_t from, std::uint32_t to) const {
        return rows[from * words_per_row() + to / 64] >> (to % 64) & 1;
    }
    bool sees_shut(std::uint32_t from, std::uint32_t to) const {
        return (shut.empty() ? rows : shut)[from * words_per_row() + to / 64] >> (to % 64) & 1;
    }
};

// How far the flow has come, for going on with it later: of the same portals and options. Whole at any time.
struct VisibilityProgress {
    bool begun = false;
    std::vector<std::uint64_t> blocks;         // which parts of the rows of ways are kept
    std::vector<std::uint64_t> reach;          // bits of all ways, those parts alone
    std::vector<std::uint64_t> proven;         // those that a line proves
    std::vector<std::uint32_t> witnesses;      // of those that none does: chains of ways, the number of ways before each
    std::vector<std::uint32_t> open, put_off;  // ways still to do; those that had no luck with their share of the budget
    std::vector<std::uint32_t> again;          // ways that are done, but for what others have found since
    std::vector<std::uint8_t> loose;           // ways that are given up
    std::uint64_t steps = 0, share = 0;        // done in all; that each had the last time round
    template <class A> void fields(A& a) { a(begun, blocks, reach, proven, witnesses, open, put_off, again, loose, steps, share); }
};
// What does not change what the end would be.
struct VisibilityRun {
    double seconds = 0;                     // 0: no limit. What is not done then keeps its loose set
    VisibilityProgress* progress = nullptr; // taken up where begun; left as far as it came, also when cancelled
    bool* stopped = nullptr;                // set to whether time was up before the end
    // CPU seconds, wave by wave: of each way, in the order they are begun, round by round those of the parts it is divided into then.
    using WaveTimes = std::vector<std::vector<std::vector<double>>>;
    std::vector<WaveTimes>* waves = nullptr;
};
std::vector<VisPortal> vis_portals(const Bsp& bsp); // those between different clusters
Result<Visibility> compute_visibility(std::span<const VisPortal> portals, std::uint32_t cluster_count,
                                      const VisibilityOptions& options, Context& context, const VisibilityRun& run = {});
// Why does one cluster see another?
struct SightChain {
    std::vector<std::uint32_t> portals;      // passed in this order; even: 2 * portal, front to back, else 2 * portal + 1
    std::vector<Vec3> source, pass;          // what the planes leave of the first and of the last of them
    std::vector<Vec3> line;                  // a line through all of them, if one was found: two points
};
// Nothing: it does not. A chain that the flow cannot rule out; one with a line where one was found.
std::optional<SightChain> find_sight(std::span<const VisPortal> portals, std::uint32_t cluster_count, std::uint32_t from, std::uint32_t to, const VisibilityOptions& options, Context& context);
void validate(const Visibility& visibility);
void check_invariants(const Visibility& visibility, Checker& checker); // the same, for all who want to know more than the first that fails

} // namespace kiln
