/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the registers ask the service for: the time, the buses, the server and the log. Their
 * context is the struct service. Internal to src/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_REGISTERS_H
#define DRIVEBRIDGE_SERVICE_REGISTERS_H

#include "drivebridge/registers.h"

extern const struct db_registers_ops service_registers_ops;

#endif
