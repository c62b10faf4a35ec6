/* SPDX-License-Identifier: Apache-2.0 */
/* Inquiries of VSMD drives on serial lines, see driver.h. Pure. */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_SERIAL_INQUIRY_H
#define DRIVEBRIDGE_DRIVER_VSMD_SERIAL_INQUIRY_H

#include "drivebridge/driver.h"

/* Longest answers of undocumented length: an identity, and all parameters as text. */
#define VSMD_IDENTITY_FRAME 64
#define VSMD_PARAMS_FRAME 1000

bool vsmd_serial_inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                         struct db_exchange *exchange);
enum db_recognised vsmd_serial_recognise(const struct db_bus_config *bus,
                                         const struct db_inquiry *inquiry, const uint8_t *frame,
                                         size_t length, struct db_inquired *said);

#endif
