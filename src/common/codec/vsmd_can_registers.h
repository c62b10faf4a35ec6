/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The registers of VSMD drives on CAN, as raw numbers: status, identity and parameters. Pure; any
 * thread. Source: VSMD CAN 2.0 protocol, sections 3, 4 and 5.2. Functions that build something
 * leave it untouched when they return an error.
 */
#ifndef DRIVEBRIDGE_CODEC_VSMD_CAN_REGISTERS_H
#define DRIVEBRIDGE_CODEC_VSMD_CAN_REGISTERS_H

#include "codec/vsmd_serial.h" /* enum vsmd_error, struct vsmd_status */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define VSMD_CAN_DRIVE_MAX 110 /* extended frames: drives are 1..110 */
#define VSMD_CAN_REG_MAX 127   /* of extended frames */
#define VSMD_CAN_STD_REG_MAX 31

/* --- status registers ------------------------------------------------------------------------- */

enum vsmd_can_status_reg {
	VSMD_CAN_STATUS_SPEED = 0x00,
	VSMD_CAN_STATUS_POSITION = 0x01,
	VSMD_CAN_STATUS_WORD = 0x02,
	VSMD_CAN_STATUS_REGS = 3,
	VSMD_CAN_IDENTITY = 0x0A, /* to 0x10: model and firmware as text */
	VSMD_CAN_IDENTITY_REGS = 7,
};

#define VSMD_CAN_IDENTITY_MAX (4 * VSMD_CAN_IDENTITY_REGS) /* characters */

/* Registers 0x00..0x02. */
void vsmd_can_get_status(const uint32_t values[VSMD_CAN_STATUS_REGS], struct vsmd_status *status);
void vsmd_can_put_status(const struct vsmd_status *status, uint32_t values[VSMD_CAN_STATUS_REGS]);

/*
 * Registers 0x0A..0x10 as a terminated text: it ends at a NUL, and blanks and FF (erased flash)
 * after it are dropped. Returns its length, or VSMD_ERR_SYNTAX for any other character that cannot
 * be printed.
 */
int vsmd_can_get_identity(const uint32_t values[VSMD_CAN_IDENTITY_REGS],
                          char text[VSMD_CAN_IDENTITY_MAX + 1]);

/* Padded with blanks. VSMD_ERR_SPACE: too long; VSMD_ERR_RANGE: one that cannot be printed. */
enum vsmd_error vsmd_can_put_identity(const char *text, uint32_t values[VSMD_CAN_IDENTITY_REGS]);

/* --- data registers --------------------------------------------------------------------------- */

#define VSMD_CAN_DATA_FIRST 0x00
#define VSMD_CAN_DATA_LAST 0x2B
#define VSMD_CAN_FIELDS_MAX 6 /* parameters in one register */

/* Where a parameter is, each in one register; a field of fewer than 32 bits shares it. */
struct vsmd_can_field {
	uint8_t reg;
	uint8_t shift; /* position of its lowest bit */
	uint8_t width; /* bits */
};

extern const struct vsmd_can_field vsmd_can_fields[VSMD_PARAM_COUNT];

/* Parameters of a register, highest field first. Returns their number; 0 for reserved registers,
 * which cannot be written. */
size_t vsmd_can_params_of(unsigned reg, enum vsmd_param params[VSMD_CAN_FIELDS_MAX]);

/* True if the register holds several fields, so that the others must be read before one is
 * written. */
bool vsmd_can_reg_packed(unsigned reg);

/* True if frames of this kind can address it. */
bool vsmd_can_reg_reachable(unsigned reg, bool extended);

/*
 * As vsmd_param_in_range, with what is different on CAN: cid 1..110, and bdr one of the documented
 * bit rates.
 */
bool vsmd_can_param_in_range(enum vsmd_param param, union db_value value);

/*
 * A parameter out of its raw register, of the type in vsmd_params; bdr in bit/s. Its range is not
 * checked: the drive is the authority on what it holds. VSMD_ERR_RANGE: does not fit the type, or
 * a code that is no bit rate.
 */
enum vsmd_error vsmd_can_extract(enum vsmd_param param, uint32_t raw, union db_value *value);

/* Stores a parameter in its raw register; the other fields stay. VSMD_ERR_RANGE: value out of
 * range. */
enum vsmd_error vsmd_can_insert(enum vsmd_param param, union db_value value, uint32_t *raw);

/* --- bit rates -------------------------------------------------------------------------------- */

/* bit/s of a code, rounded, whether documented or not; 0 without a divider. */
uint32_t vsmd_can_code_rate(uint32_t code);

/* The documented code of a bit rate; 0 when there is none. */
uint32_t vsmd_can_rate_code(uint32_t rate);

#endif
