/* SPDX-License-Identifier: Apache-2.0 */
/* What every transport to a CAN bus knows of the wire behind it. Pure; any thread. */
#ifndef DRIVEBRIDGE_TRANSPORT_CAN_WIRE_H
#define DRIVEBRIDGE_TRANSPORT_CAN_WIRE_H

#include "codec/can.h"

#include <stddef.h>
#include <stdint.h>

/* The frame at this place of a buffer of frames, which need not be aligned. */
struct db_can_frame db_can_frame_at(const uint8_t *bytes, size_t offset);

/*
 * The least bits of an exchange: of its request (whole frames) all, stuff bits included; of its
 * answer, whose content nobody knows yet, those of as few frames as can be, of the request's kind
 * and without stuff bits. answer_length: the sum over its frames of 8 + data length.
 */
uint64_t db_can_wire_bits(const uint8_t *request, size_t request_length, size_t answer_length);

#endif
