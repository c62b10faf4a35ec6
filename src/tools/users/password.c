/* SPDX-License-Identifier: Apache-2.0 */
#include "users/password.h"

#include <crypt.h>
#include <ctype.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* yescrypt with 4 MiB: its usual 16 MiB would exceed the rest of the program, for as long as a
 * login takes. */
#define METHOD "$y$"
#define COST 3

/* What has to be left when the user's name is taken out of the password. */
#define BESIDE_NAME_MIN 6

/* In lower case, without what stands before and behind. */
static const char *const common[] = {
	"password",
	"passwort",
	"passw",
	"administrator",
	"admin",
	"drivebridge",
	"iloveyou",
	"letmein",
	"welcome",
	"willkommen",
	"changeme",
	"changemenow",
	"qwertyuiop",
	"qwertyuiopasdf",
	"qwerty",
	"qwertyqwerty",
	"qwertz",
	"qwertzuiop",
	"asdfghjkl",
	"asdfghjkloe",
	"zxcvbnm",
	"yxcvbnm",
	"monkey",
	"dragon",
	"sunshine",
	"princess",
	"football",
	"baseball",
	"superman",
	"batman",
	"trustnoone",
	"starwars",
	"whatever",
	"master",
	"michael",
	"shadow",
	"secret",
	"geheim",
	"service",
	"operator",
	"engineer",
	"observer",
	"maintenance",
	"wartung",
	"gateway",
	"default",
	"guest",
	"login",
	"test",
	"testing",
	"hello",
	"hallo",
	"helloworld",
	"computer",
	"internet",
	"siemens",
	"beckhoff",
	"rockwell",
	"codesys",
	"modbus",
	"industrial",
	"automation",
	"production",
	"produktion",
	"passwordpassword",
	"adminadmin",
	"qwertyadmin",
	"adminpassword",
	"mypassword",
	"defaultpassword",
	"iloveyouforever",
	"loveyou",
	"woaini",
	"correcthorsebatterystaple",
};

/* As they stand: rows on a keyboard that are no rows of the alphabet. */
static const char *const patterns[] = {
	"1q2w3e4r5t6y", "1q2w3e4r5t",   "1qaz2wsx3edc", "1qaz2wsx",         "qazwsxedcrfv",
	"zaq12wsxcde3", "zaq12wsx",     "q1w2e3r4t5y6", "q1w2e3r4",         "abc123abc123",
	"123qweasdzxc", "123321123321", "qwe123qwe123", "112233445566",     "1234qwerasdf",
	"qwerty123456", "123456qwerty", "a1b2c3d4e5f6", "147258369",        "147258369147",
	"987654321987", "123123123123", "1234qwer",     "1234567890qwerty",
};

static unsigned count_characters(const char *text)
{
	unsigned count = 0;

	for (; *text; text++)
		count += ((unsigned char)*text & 0xC0) != 0x80;
	return count;
}

/* Letters in lower case. */
static void lower(const char *from, char *to, size_t size)
{
	size_t i = 0;

	for (; from[i] && i + 1 < size; i++)
		to[i] = (char)tolower((unsigned char)from[i]);
	to[i] = '\0';
}

/* 1 bytes or more, each as far from the one before, as in the alphabet; or the same. */
static bool is_row(const char *text)
{
	size_t length = strlen(text);
	int step = length > 1 ? text[1] - text[0] : 0;

	if (step < -1 || step > 1)
		return false;
	for (size_t i = 2; i < length; i++) {
		bool around = (step == 1 && text[i - 1] == '9' && text[i] == '0') ||
		              (step == -1 && text[i - 1] == '0' && text[i] == '9');

		/* 1234567890123 goes on behind the 0 like a row. */
		if (text[i] - text[i - 1] != step && !around)
			return false;
	}
	return true;
}

/* A piece that would be too short alone. */
static bool is_repeated(const char *text, unsigned least)
{
	size_t length = strlen(text);
	unsigned characters = 0;

	for (size_t piece = 1; 2 * piece <= length; piece++) {
		/* A character of UTF-8 ends where the next one begins. */
		if (((unsigned char)text[piece] & 0xC0) == 0x80)
			continue;
		if (++characters >= least)
			return false;
		if (strncmp(text, text + piece, length - piece) == 0)
			return true;
	}
	return false;
}

static bool is_made_of_name(const char *text, const char *user)
{
	char name[DB_PASSWORD_MAX + 1];
	size_t size;
	unsigned left = 0;

	lower(user, name, sizeof(name));
	size = strlen(name);
	if (size == 0 || !strstr(text, name))
		return false;
	for (const char *at = text; *at;) {
		bool found = strncmp(at, name, size) == 0;

		left += !found && ((unsigned char)*at & 0xC0) != 0x80;
		at += found ? size : 1;
	}
	return left < BESIDE_NAME_MIN;
}

/* As it stands, or by the word in "!P4ssw0rd123": what is neither a letter nor stands for one is
 * left out at both ends, and inside it stands for its letter. */
static bool is_common(const char *text)
{
	static const char signs[] = "0134578@$!";
	static const char letters[] = "oieastbasi";
	char word[DB_PASSWORD_MAX + 1];
	size_t begin = 0;
	size_t end = strlen(text);
	bool found = false;

	while (text[begin] && !isalpha((unsigned char)text[begin]))
		begin++;
	while (end > begin && !isalpha((unsigned char)text[end - 1]))
		end--;
	snprintf(word, sizeof(word), "%.*s", (int)(end - begin), text + begin);
	for (char *at = word; *at; at++) {
		const char *sign = strchr(signs, *at);

		if (sign)
			*at = letters[sign - signs];
	}
	for (size_t i = 0; i < sizeof(common) / sizeof(common[0]); i++)
		found = found || strcmp(word, common[i]) == 0;
	for (size_t i = 0; i < sizeof(patterns) / sizeof(patterns[0]); i++)
		found = found || strcmp(text, patterns[i]) == 0;
	explicit_bzero(word, sizeof(word));
	return found;
}

const char *db_password_judge(const char *password, const char *user, unsigned least)
{
	char text[DB_PASSWORD_MAX + 1] = "";
	const char *wrong = NULL;

	lower(password, text, sizeof(text));
	if (strlen(password) > DB_PASSWORD_MAX)
		wrong = "it is too long";
	else if (count_characters(password) < least)
		wrong = "it is too short";
	else if (is_made_of_name(text, user))
		wrong = "it is made of the user's name";
	else if (is_row(text) || is_repeated(text, least))
		wrong = "it is a row, or one piece again and again";
	else if (is_common(text))
		wrong = "it is one that everybody tries first";
	explicit_bzero(text, sizeof(text));
	return wrong;
}

/* --- hashes ----------------------------------------------------------------------------------- */

bool db_password_is_hash(const char *text)
{
	size_t length = strlen(text);

	if (length < 13 || length > DB_PASSWORD_HASH_MAX || text[0] != '$')
		return false;
	for (size_t i = 0; i < length; i++) {
		if (text[i] <= ' ' || text[i] > '~' || strchr(":;*!\\", text[i]))
			return false;
	}
	return true;
}

bool db_password_hash(const char *password, char hash[DB_PASSWORD_HASH_MAX + 1])
{
	char setting[CRYPT_GENSALT_OUTPUT_SIZE];
	struct crypt_data *data = calloc(1, sizeof(*data));
	const char *made = NULL;

	if (data && crypt_gensalt_rn(METHOD, COST, NULL, 0, setting, sizeof(setting)))
		made = crypt_rn(password, setting, data, sizeof(*data));
	if (made && strlen(made) <= DB_PASSWORD_HASH_MAX)
		snprintf(hash, DB_PASSWORD_HASH_MAX + 1, "%s", made);
	else
		made = NULL;
	if (data)
		explicit_bzero(data, sizeof(*data));
	free(data);
	return made;
}

/* Takes a time that does not depend on how much of it is right. */
bool db_password_matches(const char *hash, const char *password)
{
	struct crypt_data *data = calloc(1, sizeof(*data));
	const char *made = data ? crypt_rn(password, hash, data, sizeof(*data)) : NULL;
	size_t length = strlen(hash);
	unsigned char differ = 0;
	bool right = false;

	if (made && made[0] != '*' && strlen(made) == length) {
		for (size_t i = 0; i < length; i++)
			differ |= (unsigned char)(made[i] ^ hash[i]);
		right = differ == 0;
	}
	if (data)
		explicit_bzero(data, sizeof(*data));
	free(data);
	return right;
}
