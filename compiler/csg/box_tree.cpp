#include "compiler/csg/box_tree.h"
#include <algorithm>

namespace kiln::csg_detail {

BoxTree::BoxTree(std::span<const Box3> boxes) {
    for (std::size_t i = 0; i < boxes.size(); ++i)
        if (!boxes[i].empty()) items_.push_back(static_cast<std::uint32_t>(i));
    if (items_.empty()) return;
    nodes_.reserve(items_.size());
    build(boxes, 0, static_cast<std::uint32_t>(items_.size()));
    boxes_.reserve(items_.size());
    for (const std::uint32_t i : items_) boxes_.push_back(boxes[i]);
}

void BoxTree::build(std::span<const Box3> boxes, std::uint32_t first, std::uint32_t last) {
    const auto self = nodes_.size();
    nodes_.emplace_back();
    Box3 box, centers;
    for (std::uint32_t i = first; i < last; ++i) box.add(boxes[items_[i]]), centers.add(boxes[items_[i]].center());
    nodes_[self].box = box;
    if (last - first <= kLeafSize) {
        nodes_[self].first = first, nodes_[self].count = last - first;
        return;
    }
    const Vec3 size = centers.size();
    const std::size_t axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::uint32_t middle = first + (last - first) / 2;
    const auto at = [&](std::uint32_t i) { return items_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(first), at(middle), at(last), [&](std::uint32_t a, std::uint32_t b) {
        const double ca = boxes[a].lo[axis] + boxes[a].hi[axis], cb = boxes[b].lo[axis] + boxes[b].hi[axis];
        return ca != cb ? ca < cb : a < b;
    });
    build(boxes, first, middle);
    nodes_[self].right = static_cast<std::uint32_t>(nodes_.size());
    build(boxes, middle, last);
}

void BoxTree::query(const Box3& box, std::vector<std::uint32_t>& out) const {
    out.clear();
    if (nodes_.empty()) return;
    std::uint32_t stack[64]; // depth <= log2(2^32) + 1: halves are balanced
    int top = 0;
    stack[top++] = 0;
    while (top > 0) {
        const std::uint32_t n = stack[--top];
        const Node& node = nodes_[n];
        if (!overlap(node.box, box)) continue;
        if (node.count > 0) {
            for (std::uint32_t i = node.first; i < node.first + node.count; ++i)
                if (overlap(boxes_[i], box)) out.push_back(items_[i]);
        } else {
            stack[top++] = node.right;
            stack[top++] = n + 1;
        }
    }
    std::sort(out.begin(), out.end());
}

} // namespace kiln::csg_detail
