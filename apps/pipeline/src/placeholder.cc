#include "tutti/frontend/odometry.h"
