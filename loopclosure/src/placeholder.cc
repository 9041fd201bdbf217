#include "tutti/loopclosure/detector.h"
