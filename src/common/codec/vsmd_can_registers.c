/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_can_registers.h"

#include "codec/big_endian.h"

#include <string.h>

#define REG_BYTES 4

/* --- status registers ------------------------------------------------------------------------- */

void vsmd_can_get_status(const uint32_t values[VSMD_CAN_STATUS_REGS], struct vsmd_status *status)
{
	status->velocity = float_of_bits(values[VSMD_CAN_STATUS_SPEED]);
	status->position = int_of_bits(values[VSMD_CAN_STATUS_POSITION]);
	status->status = values[VSMD_CAN_STATUS_WORD];
}

void vsmd_can_put_status(const struct vsmd_status *status, uint32_t values[VSMD_CAN_STATUS_REGS])
{
	values[VSMD_CAN_STATUS_SPEED] = bits_of_float(status->velocity);
	values[VSMD_CAN_STATUS_POSITION] = bits_of_int(status->position);
	values[VSMD_CAN_STATUS_WORD] = status->status;
}

static bool is_printable(uint8_t character)
{
	return character >= 0x20 && character <= 0x7E;
}

int vsmd_can_get_identity(const uint32_t values[VSMD_CAN_IDENTITY_REGS],
                          char text[VSMD_CAN_IDENTITY_MAX + 1])
{
	uint8_t bytes[VSMD_CAN_IDENTITY_MAX];
	const uint8_t *nul;
	size_t length;

	for (size_t i = 0; i < VSMD_CAN_IDENTITY_REGS; i++)
		put_be32(values[i], bytes + i * REG_BYTES);
	nul = memchr(bytes, 0, sizeof(bytes));
	length = nul ? (size_t)(nul - bytes) : sizeof(bytes);
	while (length > 0 && (bytes[length - 1] == ' ' || bytes[length - 1] == UINT8_MAX))
		length--;
	for (size_t i = 0; i < length; i++) {
		if (!is_printable(bytes[i]))
			return VSMD_ERR_SYNTAX;
	}
	memcpy(text, bytes, length);
	text[length] = '\0';
	return (int)length;
}

enum vsmd_error vsmd_can_put_identity(const char *text, uint32_t values[VSMD_CAN_IDENTITY_REGS])
{
	uint8_t bytes[VSMD_CAN_IDENTITY_MAX];
	size_t length = strlen(text);

	if (length > sizeof(bytes))
		return VSMD_ERR_SPACE;
	memset(bytes, ' ', sizeof(bytes));
	for (size_t i = 0; i < length; i++) {
		bytes[i] = (uint8_t)text[i];
		if (!is_printable(bytes[i]))
			return VSMD_ERR_RANGE;
	}
	for (size_t i = 0; i < VSMD_CAN_IDENTITY_REGS; i++)
		values[i] = get_be32(bytes + i * REG_BYTES);
	return VSMD_OK;
}

/* --- data registers --------------------------------------------------------------------------- */

#define WHOLE 32

const struct vsmd_can_field vsmd_can_fields[VSMD_PARAM_COUNT] = {
	[VSMD_CID] = { 0x00, 0, WHOLE },     [VSMD_BDR] = { 0x01, 0, WHOLE },
	[VSMD_MCS] = { 0x02, 0, WHOLE },     [VSMD_SPD] = { 0x03, 0, WHOLE },
	[VSMD_ACC] = { 0x04, 0, WHOLE },     [VSMD_DEC] = { 0x05, 0, WHOLE },
	[VSMD_CRA] = { 0x06, 0, WHOLE },     [VSMD_CRN] = { 0x07, 0, WHOLE },
	[VSMD_CRH] = { 0x08, 0, WHOLE },     [VSMD_S1F] = { 0x09, 24, 8 },
	[VSMD_S1R] = { 0x09, 16, 8 },        [VSMD_S2F] = { 0x09, 8, 8 },
	[VSMD_S2R] = { 0x09, 0, 8 },         [VSMD_S3F] = { 0x0A, 24, 8 },
	[VSMD_S3R] = { 0x0A, 16, 8 },        [VSMD_S4F] = { 0x0A, 8, 8 },
	[VSMD_S4R] = { 0x0A, 0, 8 },         [VSMD_S5F] = { 0x0B, 24, 8 },
	[VSMD_S5R] = { 0x0B, 16, 8 },        [VSMD_S6F] = { 0x0B, 8, 8 },
	[VSMD_S6R] = { 0x0B, 0, 8 },         [VSMD_PUD] = { 0x0C, 0, 6 },
	[VSMD_S1] = { 0x0D, 0, 1 },          [VSMD_S2] = { 0x0D, 1, 1 },
	[VSMD_S3] = { 0x0D, 2, 1 },          [VSMD_S4] = { 0x0D, 3, 1 },
	[VSMD_S5] = { 0x0D, 4, 1 },          [VSMD_S6] = { 0x0D, 5, 1 },
	[VSMD_ZMD] = { 0x0E, 0, WHOLE },     [VSMD_OSV] = { 0x0F, 0, WHOLE },
	[VSMD_SNR] = { 0x10, 0, WHOLE },     [VSMD_ZSD] = { 0x11, 0, WHOLE },
	[VSMD_ZSP] = { 0x12, 0, WHOLE },     [VSMD_DAR] = { 0x14, 0, WHOLE },
	[VSMD_RES] = { 0x15, 0, WHOLE },     [VSMD_MSR] = { 0x17, 24, 8 },
	[VSMD_MSV] = { 0x17, 16, 8 },        [VSMD_PSR] = { 0x17, 8, 8 },
	[VSMD_PSV] = { 0x17, 0, 8 },         [VSMD_PAE] = { 0x18, 0, WHOLE },
	[VSMD_ZAR] = { 0x1A, 0, WHOLE },     [VSMD_ZCR] = { 0x1C, 0, WHOLE },
	[VSMD_N1RATIO] = { 0x1D, 0, WHOLE }, [VSMD_N2RATIO] = { 0x1E, 0, WHOLE },
	[VSMD_N3RATIO] = { 0x1F, 0, WHOLE }, [VSMD_EMOD] = { 0x20, 0, WHOLE },
	[VSMD_ELNS] = { 0x21, 0, WHOLE },    [VSMD_ESTP] = { 0x22, 0, WHOLE },
	[VSMD_ERTY] = { 0x23, 0, WHOLE },    [VSMD_EDIR] = { 0x24, 0, WHOLE },
	[VSMD_EZ] = { 0x25, 0, WHOLE },      [VSMD_EWR] = { 0x26, 0, WHOLE },
	[VSMD_ERATIO] = { 0x27, 0, WHOLE },  [VSMD_ESDS] = { 0x28, 0, WHOLE },
	[VSMD_SML] = { 0x2A, 0, WHOLE },     [VSMD_SPL] = { 0x2B, 0, WHOLE },
	[VSMD_DMD] = { 0x13, 0, WHOLE },     [VSMD_SDS] = { 0x1B, 0, WHOLE },
	[VSMD_CAF] = { 0x19, 0, WHOLE },
};

size_t vsmd_can_params_of(unsigned reg, enum vsmd_param params[VSMD_CAN_FIELDS_MAX])
{
	size_t count = 0;

	for (unsigned i = 0; i < VSMD_PARAM_COUNT; i++) {
		size_t at;

		if (vsmd_can_fields[i].reg != reg || count == VSMD_CAN_FIELDS_MAX)
			continue;
		for (at = count; at > 0; at--) {
			if (vsmd_can_fields[params[at - 1]].shift > vsmd_can_fields[i].shift)
				break;
			params[at] = params[at - 1];
		}
		params[at] = (enum vsmd_param)i;
		count++;
	}
	return count;
}

bool vsmd_can_reg_packed(unsigned reg)
{
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];

	return vsmd_can_params_of(reg, params) > 0 && vsmd_can_fields[params[0]].width < WHOLE;
}

bool vsmd_can_reg_reachable(unsigned reg, bool extended)
{
	return reg <= (extended ? VSMD_CAN_REG_MAX : VSMD_CAN_STD_REG_MAX);
}

bool vsmd_can_param_in_range(enum vsmd_param param, union db_value value)
{
	switch (param) {
	case VSMD_CID:
		return value.u >= 1 && value.u <= VSMD_CAN_DRIVE_MAX;
	case VSMD_BDR:
		return vsmd_can_rate_code(value.u) != 0;
	default:
		return vsmd_param_in_range(param, value);
	}
}

/* The bits of a field, not yet shifted to their place. */
static uint32_t field_mask(const struct vsmd_can_field *field)
{
	return UINT32_MAX >> (WHOLE - field->width);
}

enum vsmd_error vsmd_can_extract(enum vsmd_param param, uint32_t raw, union db_value *value)
{
	const struct vsmd_can_field *field = &vsmd_can_fields[param];
	uint32_t bits = raw >> field->shift & field_mask(field);

	if (param == VSMD_BDR) {
		bits = vsmd_can_code_rate(raw);
		if (bits == 0)
			return VSMD_ERR_RANGE;
	}
	if (vsmd_params[param].type == DB_U16 && bits > UINT16_MAX)
		return VSMD_ERR_RANGE;
	/* Signed and floating registers are whole ones: their bits are the value's. */
	value->u = bits;
	return VSMD_OK;
}

enum vsmd_error vsmd_can_insert(enum vsmd_param param, union db_value value, uint32_t *raw)
{
	const struct vsmd_can_field *field = &vsmd_can_fields[param];
	uint32_t mask = field_mask(field) << field->shift;

	if (!vsmd_can_param_in_range(param, value))
		return VSMD_ERR_RANGE;
	if (param == VSMD_BDR)
		value.u = vsmd_can_rate_code(value.u);
	*raw = (*raw & ~mask) | (value.u << field->shift & mask);
	return VSMD_OK;
}

/* --- bit rates -------------------------------------------------------------------------------- */

#define CAN_CLOCK 54000000u /* Hz */

struct rate {
	uint32_t rate;
	uint32_t code;
};

static const struct rate rates[] = {
	{ 20000, 0x1C2132 }, { 25000, 0x168132 }, { 30000, 0x12C132 }, { 40000, 0xE1132 },
	{ 50000, 0xB4132 },  { 60000, 0x5A163 },  { 75000, 0x78132 },  { 80000, 0x4B153 },
	{ 90000, 0x4B143 },  { 100000, 0x5A132 }, { 125000, 0x48132 }, { 150000, 0x3C132 },
	{ 200000, 0x2D132 }, { 250000, 0x24132 }, { 300000, 0x1E132 }, { 400000, 0xF153 },
	{ 500000, 0x12132 }, { 600000, 0x9163 },  { 750000, 0x8153 },  { 900000, 0x6163 },
	{ 1000000, 0x9132 },
};

#define RATES (sizeof(rates) / sizeof(rates[0]))

/* Divider above bit 12, then jump width and the two segments of a bit, four bits each. */
uint32_t vsmd_can_code_rate(uint32_t code)
{
	uint32_t quanta = 1 + (code >> 4 & 0xF) + (code & 0xF);
	uint32_t divider = (code >> 12) * quanta;

	return divider == 0 ? 0 : (CAN_CLOCK + divider / 2) / divider;
}

uint32_t vsmd_can_rate_code(uint32_t rate)
{
	for (size_t i = 0; i < RATES; i++) {
		if (rates[i].rate == rate)
			return rates[i].code;
	}
	return 0;
}
