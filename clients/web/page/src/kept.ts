// Choices and tokens that survive a reload: this browser's, for each page address.

/** The kept choice; undefined when there is none or the browser keeps nothing. */
export function kept(name: string): unknown {
  try {
    return JSON.parse(localStorage.getItem(`dtact ${name}`) ?? "null") ?? undefined;
  } catch {
    return undefined;
  }
}

export function keep(name: string, choice: unknown): void {
  try {
    localStorage.setItem(`dtact ${name}`, JSON.stringify(choice));
  } catch {
    // A browser without storage forgets the choice, and works otherwise.
  }
}

/** The words of a token stay with this window alone, and end with it. */
const TOKEN_PREFIX = "dtact token ";

/** The token entered for a sensor; empty when there is none or the browser keeps nothing. */
export function keptToken(name: string): string {
  try {
    return sessionStorage.getItem(TOKEN_PREFIX + name) ?? "";
  } catch {
    return "";
  }
}

/** The tokens entered for all sensors. */
export function keptTokens(): string[] {
  try {
    const entries: [string, string][] = Object.entries(sessionStorage);
    return entries.filter(([key]) => key.startsWith(TOKEN_PREFIX)).map(([, token]) => token);
  } catch {
    return [];
  }
}

export function keepToken(name: string, token: string): void {
  try {
    sessionStorage.setItem(TOKEN_PREFIX + name, token);
  } catch {
    // A browser without storage asks for the token again after a reload.
  }
}
