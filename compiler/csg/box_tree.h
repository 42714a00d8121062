// Private: a static tree of boxes. Built and asked in near-linear time whatever the sizes; answers come in
// ascending index order.
#pragma once
#include "libs/math/vec.h"
#include <cstdint>
#include <span>
#include <vector>

namespace kiln::csg_detail {

class BoxTree {
public:
    explicit BoxTree(std::span<const Box3> boxes); // empty boxes are left out
    // Indices of the boxes that touch or overlap `box`, ascending, into `out` (cleared first).
    void query(const Box3& box, std::vector<std::uint32_t>& out) const;

private:
    static constexpr std::uint32_t kLeafSize = 4;
    struct Node {
        Box3 box;
        std::uint32_t first = 0, count = 0; // count > 0: leaf over items_[first, first + count)
        std::uint32_t right = 0;            // else: left child follows, right child here
    };
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> items_;
    std::vector<Box3> boxes_; // parallel to items_
    void build(std::span<const Box3> boxes, std::uint32_t first, std::uint32_t last);
};

} // namespace kiln::csg_detail
