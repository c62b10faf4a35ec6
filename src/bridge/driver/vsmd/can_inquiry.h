/* SPDX-License-Identifier: Apache-2.0 */
/* Inquiries of VSMD drives on CAN, see driver.h. Pure. */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_CAN_INQUIRY_H
#define DRIVEBRIDGE_DRIVER_VSMD_CAN_INQUIRY_H

#include "codec/vsmd_can.h"
#include "drivebridge/driver.h"

bool vsmd_can_inquire(const struct vsmd_can_style *style, const struct db_inquiry *inquiry,
                      struct db_exchange *exchange);
enum db_recognised vsmd_can_recognise(const struct vsmd_can_style *style,
                                      const struct db_inquiry *inquiry, const uint8_t *bytes,
                                      size_t length, struct db_inquired *said);

#endif
