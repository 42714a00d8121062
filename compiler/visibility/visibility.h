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
#include <span>

namespace kiln {

struct VisPortal {
    std::uint32_t cluster_front = 0, cluster_back = 0;
    std::vector<Vec3> winding; // CCW seen from the front cluster
    template <class A> void fields(A& a) { a(cluster_front, cluster_back, winding); }
};

struct VisibilityOptions {
    bool fast = false;         // flood only: valid, looser
    double epsilon = 1e-3;     // map units; rounding may only open portals, never close them
    std::uint64_t step_budget = 0; // flow steps per portal, 0: none; a portal over budget keeps its flood set
    template <class A> void fields(A& a) { a(fast, epsilon, step_budget); }
};

struct Visibility {
    std::uint32_t cluster_count = 0;
    std::uint32_t portals_over_budget = 0;
    std::vector<std::uint64_t> rows; // cluster_count * words_per_row
    template <class A> void fields(A& a) { a(cluster_count, portals_over_budget, rows); }
    std::size_t words_per_row() const { return (cluster_count + 63) / 64; }
    bool sees(std::uint32_t from, std::uint32_t to) const {
        return rows[from * words_per_row() + to / 64] >> (to % 64) & 1;
    }
};
std::vector<VisPortal> vis_portals(const Bsp& bsp); // those between different clusters
Result<Visibility> compute_visibility(std::span<const VisPortal> portals, std::uint32_t cluster_count,
                                      const VisibilityOptions& options, Context& context);
void validate(const Visibility& visibility);
void check_invariants(const Visibility& visibility, Checker& checker); // the same, for all who want to know more than the first that fails

} // namespace kiln
