// Textures of a level's materials: found in directories, filtered with a mip chain.
#pragma once
#include "libs/core/context.h"
#include "libs/image/image.h"
#include "libs/math/vec.h"
#include <string>
#include <vector>

namespace kiln {

class Texture {
public:
    Texture() = default;
    explicit Texture(Image image);
    bool empty() const { return mips_.empty(); }
    // u, v: 1 = one repetition; footprint: of the pixel, in repetitions. RGBA, trilinear, repeating.
    std::array<float, 4> at(double u, double v, double footprint_u, double footprint_v) const;

private:
    std::vector<Image> mips_; // 4 channels
};

// The file `name` (as the level has it; also by its last part, and with .png, .tga) in the first directory that has it.
// Empty: not found or not readable, which is reported as a note.
Texture load_texture(const std::string& name, Transfer transfer, const std::vector<std::string>& directories,
                     Context& context);

} // namespace kiln
