/* SPDX-License-Identifier: Apache-2.0 */
/*
 * opcua-export: writes docs/opcua-keys.csv, every key that a configuration of drivebridge-opcua may have; with "names" a
 * line REGISTER,NAME for each name of a register that it reads: what the address space calls it; with "more" a line
 * TYPE,FOLDER,NAME,KIND,"DESCRIPTION" for each variable that is no register; with "outputs" a line NAME,"DESCRIPTION" for
 * each output of the methods.
 */
#include "opcua/config.h"
#include "opcua/model.h"
#include "opcua/names.h"

#include <string.h>

static int write_names(FILE *in, FILE *out)
{
	char line[256];

	while (fgets(line, sizeof(line), in)) {
		char name[DB_OPCUA_NAME_MAX];

		line[strcspn(line, "\n")] = '\0';
		db_opcua_name_of(line, name);
		(void)fprintf(out, "%s,%s\n", line, name);
	}
	return ferror(in) || fflush(out) ? 1 : 0;
}

static void write_diagnosis(FILE *out, bool gateway)
{
	json_t *registers = json_array();
	size_t i;
	json_t *reg;

	db_opcua_registers_add_diagnosis(registers, gateway);
	json_array_foreach(registers, i, reg)
	{
		char name[DB_OPCUA_NAME_MAX];

		db_opcua_name_of(json_string_value(json_object_get(reg, "name")), name);
		(void)fprintf(out, "%s,Diagnosis,%s,%s,\"%s\"\n",
		              gateway ? "GatewayType" : "DriveType", name,
		              json_string_value(json_object_get(reg, "type")),
		              json_string_value(json_object_get(reg, "description")));
	}
	json_decref(registers);
}

static int write_more(FILE *out)
{
	write_diagnosis(out, false);
	write_diagnosis(out, true);
	return fflush(out) == 0 ? 0 : 1;
}

static int write_outputs(FILE *out)
{
	for (size_t i = 0; i < DB_OPCUA_OUTPUTS_COUNT; i++)
		(void)fprintf(out, "%s,\"%s\"\n", db_opcua_outputs[i].name,
		              db_opcua_outputs[i].text);
	return fflush(out) == 0 ? 0 : 1;
}

int main(int argc, char **argv)
{
	if (argc == 2 && strcmp(argv[1], "names") == 0)
		return write_names(stdin, stdout);
	if (argc == 2 && strcmp(argv[1], "more") == 0)
		return write_more(stdout);
	if (argc == 2 && strcmp(argv[1], "outputs") == 0)
		return write_outputs(stdout);
	return db_settings_write_csv(db_opcua_keys, stdout) == 0 ? 0 : 1;
}
