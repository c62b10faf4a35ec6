/* SPDX-License-Identifier: Apache-2.0 */
/*
 * opcua-export: writes docs/opcua-keys.csv, every key that a configuration of drivebridge-opcua may have; with "names" a
 * line REGISTER,NAME for each name of a register that it reads: what the address space calls it.
 */
#include "opcua/config.h"
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

int main(int argc, char **argv)
{
	if (argc == 2 && strcmp(argv[1], "names") == 0)
		return write_names(stdin, stdout);
	return db_settings_write_csv(db_opcua_keys, stdout) == 0 ? 0 : 1;
}
