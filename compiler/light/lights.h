// Light entities are read by a folder of their own, so that the readers of levels and of light meet here.
#pragma once
#include "compiler/lights/lights.h"
