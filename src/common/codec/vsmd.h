/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Properties of a VSMD drive on every bus: status bits and parameters. Pure data. Source: VSMD
 * custom protocol for RS232 & RS485, sections 2.3 and 3.
 */
#ifndef DRIVEBRIDGE_CODEC_VSMD_H
#define DRIVEBRIDGE_CODEC_VSMD_H

#include "drivebridge/value.h"

/* Status word, section 2.3. Bits that the document calls reserved have names where later manuals
 * give them. */
enum vsmd_status_bit {
	VSMD_ST_S1 = 1u << 0,
	VSMD_ST_S2 = 1u << 1,
	VSMD_ST_S3 = 1u << 2,
	VSMD_ST_S4 = 1u << 3,
	VSMD_ST_POS_REACHED = 1u << 4, /* hint only */
	VSMD_ST_SPD_REACHED = 1u << 5, /* hint only */
	VSMD_ST_FLT = 1u << 6,
	VSMD_ST_ORG = 1u << 7,
	VSMD_ST_STP = 1u << 8,
	VSMD_ST_CMD_WRG = 1u << 9,
	VSMD_ST_FLASH_ERR = 1u << 10,
	VSMD_ST_ACTION = 1u << 11,
	VSMD_ST_HS = 1u << 12,
	VSMD_ST_PWR = 1u << 13,
	VSMD_ST_ZERO = 1u << 14,
	VSMD_ST_S5 = 1u << 16,
	VSMD_ST_S6 = 1u << 17,
	VSMD_ST_OVER_TEMPERATURE = 1u << 20,
	VSMD_ST_OVER_CURRENT = 1u << 21,
	VSMD_ST_VOLTAGE = 1u << 22,
	VSMD_ST_ENC_ERR = 1u << 24,
	VSMD_ST_ACT = 1u << 27,
};

/* The same, ascending, with their names. */
#define VSMD_STATUS_BITS 22
extern const struct db_drive_bit vsmd_status_bits[VSMD_STATUS_BITS];

/* Parameters in the order of section 3.1. The index is used only in this program. */
enum vsmd_param {
	VSMD_BDR,
	VSMD_CID,
	VSMD_MCS,
	VSMD_SPD,
	VSMD_ACC,
	VSMD_DEC,
	VSMD_CRA,
	VSMD_CRN,
	VSMD_CRH,
	VSMD_S1F,
	VSMD_S1R,
	VSMD_S2F,
	VSMD_S2R,
	VSMD_S3F,
	VSMD_S3R,
	VSMD_S4F,
	VSMD_S4R,
	VSMD_S5F,
	VSMD_S5R,
	VSMD_S6F,
	VSMD_S6R,
	VSMD_S1,
	VSMD_S2,
	VSMD_S3,
	VSMD_S4,
	VSMD_S5,
	VSMD_S6,
	VSMD_PUD,
	VSMD_PAE,
	VSMD_DAR,
	VSMD_ZMD,
	VSMD_ZAR,
	VSMD_SNR,
	VSMD_OSV,
	VSMD_ZSD,
	VSMD_ZSP,
	VSMD_ZCR,
	VSMD_MSR,
	VSMD_MSV,
	VSMD_PSR,
	VSMD_PSV,
	VSMD_SML,
	VSMD_SPL,
	VSMD_EMOD,
	VSMD_ELNS,
	VSMD_ESTP,
	VSMD_EZ,
	VSMD_ESDS,
	VSMD_ERTY,
	VSMD_EDIR,
	VSMD_EWR,
	VSMD_ERATIO,
	VSMD_N1RATIO,
	VSMD_N2RATIO,
	VSMD_N3RATIO,
	VSMD_RES,
	/* Seen in the field, dmd also in a document's example; described nowhere. */
	VSMD_DMD,
	VSMD_SDS,
	VSMD_SERIAL_PARAM_COUNT,
	VSMD_CAF = VSMD_SERIAL_PARAM_COUNT, /* on CAN only */
	VSMD_PARAM_COUNT
};

/* On RS485 and RS232 the first VSMD_SERIAL_PARAM_COUNT of these. */
extern const struct db_param vsmd_params[VSMD_PARAM_COUNT];
/* On CAN: the same names and types, with CAN's ranges of bdr and cid. */
extern const struct db_param vsmd_can_params[VSMD_PARAM_COUNT];

/* True when the value is inside the documented range, also where that has holes (res: 0 or
 * 1000..100000; zmd: 0..7; dar 0..60; eratio > 0). */
bool vsmd_param_in_range(enum vsmd_param param, union db_value value);

/* Index of a vendor name, or -1. The name need not be terminated. */
int vsmd_param_find(const char *name, size_t length);

/* Speed and position ranges of sections 2.4 (errata applied). */
#define VSMD_SPEED_MAX 192000.0f
#define VSMD_SHAKE_FREQ_MIN 0.2f
#define VSMD_SHAKE_FREQ_MAX 20.0f
#define VSMD_SHAKE_FREQ_MIN_CAN 0.1f

#endif
