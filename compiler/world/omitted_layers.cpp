#include "compiler/world/omitted_layers.h"
#include <map>

namespace kiln {

// Layers and groups are func_group entities with an id; what is in a group names the group alone, the outermost group
// or a lone entity names its layer, and those of the default layer name none.
std::vector<std::uint8_t> omitted_by_layer(const Document& document) {
    std::vector<std::uint8_t> omitted(document.entities.size());
    if (document.format == MapFormat::vmf) return omitted;
    const auto is_marked = [](const DocEntity& e) { return e.number("_tb_layer_omit_from_export", 0) == 1; };
    struct Group {
        std::string_view layer, group;
    };
    std::map<std::string_view, bool> layers; // by id: marked?
    std::map<std::string_view, Group> groups;
    bool any = false;
    for (const DocEntity& e : document.entities) {
        any = any || is_marked(e);
        const std::string_view type = e.get("_tb_type");
        if (type == "_tb_layer") layers[e.get("_tb_id")] = is_marked(e);
        if (type == "_tb_group") groups[e.get("_tb_id")] = {e.get("_tb_layer"), e.get("_tb_group")};
    }
    if (!any) return omitted;
    const bool default_marked = is_marked(document.entities[0]);
    for (std::size_t i = 0; i < omitted.size(); ++i) {
        const DocEntity& e = document.entities[i];
        if (e.get("_tb_type") == "_tb_layer") {
            omitted[i] = is_marked(e);
            continue;
        }
        std::string_view layer = e.get("_tb_layer"), group = e.get("_tb_group");
        for (std::size_t depth = 0; !group.empty() && depth <= groups.size(); ++depth) { // ids may name each other in a circle
            const auto it = groups.find(group);
            if (it == groups.end()) break;
            layer = it->second.layer, group = it->second.group;
        }
        const auto it = layers.find(layer);
        omitted[i] = it == layers.end() ? default_marked : it->second;
    }
    return omitted;
}

} // namespace kiln
